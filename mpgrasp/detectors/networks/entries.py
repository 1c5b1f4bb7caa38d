"""Forms of the tensors in a weights file, compared with those that its network needs; knows no torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import WeightsError

FLOATS = ("float16", "bfloat16", "float32")
"""Types that numbers of a network may be stored in."""

_NAMED = 3  # tensors that an error names
_SAFETENSORS = {
    "F64": "float64", "F32": "float32", "F16": "float16", "BF16": "bfloat16", "BOOL": "bool", "U8": "uint8",
    "I8": "int8", "I16": "int16", "I32": "int32", "I64": "int64",
}  # fmt: skip


class Entry(NamedTuple):
    """Form of one tensor."""

    shape: tuple[int, ...]
    dtype: str
    """As torch calls it, such as "float32"."""


def stored_entries(file: Any) -> dict[str, Entry]:
    """Return the forms of the tensors in an open safetensors file, without reading them."""
    slices = {key: file.get_slice(key) for key in file.keys()}  # noqa: SIM118 (not a mapping)
    return {
        key: Entry(tuple(part.get_shape()), _SAFETENSORS.get(part.get_dtype(), part.get_dtype()))
        for key, part in slices.items()
    }


def check_entries(found: Mapping[str, Entry], needed: Mapping[str, Entry], path: Path | str) -> None:
    """Raise WeightsError unless a file has the tensors that a network needs, in those shapes, as floats.

    What the network counts in whole numbers is stored in the type that it counts in.
    """
    missing = sorted(needed.keys() - found.keys())
    unknown = sorted(found.keys() - needed.keys())
    if missing or unknown:
        lists = {"missing": missing, "unexpected": unknown}
        said = [f"{len(names)} {what}: {_some(names)}" for what, names in lists.items() if names]
        raise WeightsError(
            f"{path}: weights do not fit the network",
            got="; ".join(said),
            allowed=f"the {len(needed)} tensors of its state dict",
        )
    for key, entry in needed.items():
        allowed = FLOATS if entry.dtype in FLOATS else (entry.dtype,)
        if found[key].shape != entry.shape:
            raise WeightsError(
                f"{path}: weights do not fit the network, first at {key}",
                got=found[key].shape,
                allowed=str(entry.shape),
            )
        if found[key].dtype not in allowed:
            raise WeightsError(
                f"{path}: weights of the wrong type, first at {key}", got=found[key].dtype, allowed=allowed
            )


def check_numbers(numbers: Mapping[str, NDArray[Any]], path: Path | str) -> None:
    """Raise WeightsError unless all numbers of a network are finite, and variances not below zero."""
    for key, value in numbers.items():
        if not np.isfinite(value).all():
            raise WeightsError(
                f"{path}: weights that are not finite, first at {key}",
                got="NaN or infinity",
                allowed="numbers",
            )
        if key.endswith("running_var") and value.size and float(value.min()) < 0:
            raise WeightsError(
                f"{path}: a variance below zero in {key}", got=float(value.min()), allowed="0 and above"
            )


def _some(names: Sequence[str]) -> str:
    more = len(names) - _NAMED
    return ", ".join(name[:60] for name in names[:_NAMED]) + (f" and {more} more" if more > 0 else "")
