"""Laws of results as JSON values."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np
import pytest

from mpgrasp.files.json_values import difference, differences, json_value, one_line
from mpgrasp.outcome import Outcome


@dataclass(frozen=True)
class Point:
    x: float
    rest: Any = None


class Row(msgspec.Struct, omit_defaults=True):
    name: str
    inner: Row | None = None


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, None),
        (True, True),
        (2**70, 2**70),
        (1 / 3, 0.333333333),
        (np.float32(0.1), 0.100000001),
        (np.float64(math.nan), None),
        (-math.inf, None),
        (np.bool_(False), False),
        (np.array([[1.0, math.nan], [2.0, 3.0]]), [[1.0, None], [2.0, 3.0]]),
        (np.arange(3), [0, 1, 2]),
        (np.array(2.5), 2.5),
        (Outcome.SUCCESS, "success"),
        (Row("a", Row("b")), {"name": "a", "inner": {"name": "b"}}),
        ({Outcome.SLIPPED: 1, 3: (1, 2)}, {"slipped": 1, "3": [1, 2]}),
        (MappingProxyType({"a": np.int64(1)}), {"a": 1}),
        (Counter("aab"), {"a": 2, "b": 1}),
        ({"b", "a"}, ["a", "b"]),
        (Path("a/b"), "a/b"),
        (Point(1e-20 / 3, Point(2.0)), {"x": 3.33333333e-21, "rest": {"x": 2.0, "rest": None}}),
        (object(), "builtins.object"),
        (Point, f"{__name__}.Point"),
        (math.hypot, "math.hypot"),
    ],
)
def test_every_value_has_one_form_in_json(value: Any, expected: Any) -> None:
    found = json_value(value)
    assert type(found) is type(expected)
    assert found == expected
    assert json_value(found) == found
    assert json.loads(json.dumps(found, allow_nan=False)) == expected


def test_keys_keep_their_order() -> None:
    assert list(json_value({"b": 1, "a": 2})) == ["b", "a"]
    assert list(json_value(Point(1.0))) == ["x", "rest"]


def test_equal_records_have_equal_lines() -> None:
    assert one_line({"b": 1, "a": (0.1 + 0.2,)}) == one_line({"a": [np.float64(0.3)], "b": 1})
    assert one_line({"b": 1, "a": [0.3]}) == '{"a": [0.3], "b": 1}\n'


def test_a_difference_is_the_first_and_names_its_place() -> None:
    a = {"seed": 0, "suites": [{"name": "thin"}, {"name": "single"}], "list": [1, 2]}
    assert difference(a, a) is None
    assert difference(a, a | {"suites": [{"name": "thin"}, {"name": "double"}]}) == (
        "suites.1.name", "single", "double"
    )  # fmt: skip
    assert difference(a, a | {"list": [1, 2, 3]}) == ("list", [1, 2], [1, 2, 3])
    found = difference(a, a | {"new": 1})
    assert found is not None
    assert found.words("then", "now") == "new: null then, 1 now"


def test_all_differences_are_those_of_the_values_within() -> None:
    a = {"seed": 0, "suites": [{"name": "thin", "k": 1}, {"name": "single", "k": 1}], "list": [1, 2]}
    b = {"seed": 1, "suites": [{"name": "thin", "k": 2}, {"name": "double", "k": 1}], "list": [2, 1]}
    assert [found.path for found in differences(a, b)] == ["seed", "suites.0.k", "suites.1.name", "list"]
    assert list(differences(a, a)) == []
