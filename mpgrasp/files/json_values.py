"""Configurations and results as plain JSON values."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

SIGNIFICANT_DIGITS = 9
"""Digits of floats in result files: more than anything here is measured to, fewer than the last bits."""


def json_value(value: Any) -> Any:
    """Return a JSON-ready copy: dataclasses, records, mappings as dicts, arrays, sequences and sets as lists.

    Keys keep their order, floats `SIGNIFICANT_DIGITS`; NaN and infinities become None. What JSON has no form
    for is given by the name of its class, which is the same in every process.
    """
    if value is None or (isinstance(value, bool | int | str) and not isinstance(value, Enum)):
        return value
    if isinstance(value, Enum):
        return json_value(value.value)
    if isinstance(value, float | np.floating):
        number = float(value)
        return float(f"{number:.{SIGNIFICANT_DIGITS}g}") if math.isfinite(number) else None
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: json_value(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, msgspec.Struct):
        return json_value(msgspec.to_builtins(value))
    if isinstance(value, Mapping):
        return {str(json_value(key)): json_value(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return json_value(value.tolist())
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    if isinstance(value, set | frozenset):
        return sorted((json_value(item) for item in value), key=str)
    if isinstance(value, Path):
        return str(value)
    kind = value if isinstance(value, type) or callable(value) else type(value)
    return f"{kind.__module__}.{getattr(kind, '__qualname__', type(kind).__qualname__)}"


def one_line(record: Mapping[str, Any]) -> str:
    """Return a record as one line of JSON with sorted keys and a line end: equal records, equal bytes."""
    return json.dumps(json_value(record), sort_keys=True, allow_nan=False, separators=(", ", ": ")) + "\n"


class Difference(NamedTuple):
    """A place in which two JSON values differ."""

    path: str
    """Keys and numbers of items on the way to it, with dots between them."""
    a: Any
    b: Any

    def words(self, a: str, b: str) -> str:
        """Return both values in JSON, each with its place or time behind it: "seed: 0 then, 1 now"."""
        return f"{self.path}: {json.dumps(self.a)} {a}, {json.dumps(self.b)} {b}"


def difference(a: Any, b: Any, where: str = "") -> Difference | None:
    """Return the first place in which two JSON values differ, as `differences` has them; None if equal."""
    return next(differences(a, b, where), None)


def differences(a: Any, b: Any, where: str = "") -> Iterator[Difference]:
    """Return every place in which two JSON values differ.

    Lists of dicts are gone through item by item if they are of one length; other lists are given as a whole.
    A key that one of them lacks is None there.
    """
    if isinstance(a, dict) and isinstance(b, dict):
        for key in [*a, *(k for k in b if k not in a)]:
            yield from differences(a.get(key), b.get(key), f"{where}.{key}" if where else key)
        return
    if a == b:
        return
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        items = [(k, *both) for k, both in enumerate(zip(a, b, strict=True)) if isinstance(both[0], dict)]
        within = [found for k, x, y in items for found in differences(x, y, f"{where}.{k}")]
        if within:
            yield from within
            return
    yield Difference(where, a, b)
