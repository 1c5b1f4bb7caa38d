"""Laws of assignments on the command line."""

from __future__ import annotations

import math
from typing import Any

import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.settings.assignment import parse_assignments, parse_value


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4/3", 4 / 3), ("pi/2", math.pi / 2), ("-pi", -math.pi), ("2*(1 + 0.5)", 3.0), ("1e-3", 1e-3),
        ("7", 7), ("-0.5", -0.5), ("true", True), ("false", False), ("none", None), ('"pool"', "pool"),
        ("pool", "pool"), ("[1, 2.5]", [1, 2.5]),
        ("[[0, 0, pi/2], [0.1, 0, 0]]", [[0, 0, math.pi / 2], [0.1, 0, 0]]),
        ('["key", "ruler"]', ["key", "ruler"]), ("[]", []), ("{ box = [1, 2, 3] }", {"box": [1, 2, 3]}),
    ],
)  # fmt: skip
def test_a_value_is_toml_arithmetic_or_a_word(text: str, expected: Any) -> None:
    found = parse_value(text, "there")
    assert found == expected
    assert type(found) is type(expected)


@pytest.mark.parametrize(
    "text",
    ["", "4/0", "2**9999", "__import__('os')", "().__class__", "[1", "x y", "pi()", "1\nother = 2",
     "true + 1", "a.b", "'a' * 3", "1 if 1 else 2", "(" * 300 + ")" * 300, "lambda: 1"],
)  # fmt: skip
def test_anything_else_is_refused_and_never_evaluated(text: str) -> None:
    with pytest.raises(ConfigError, match="there is unusable"):
        parse_value(text, "there")


def test_keys_within_keys_make_tables_and_the_last_value_of_a_key_counts() -> None:
    texts = ["controller.grid.extent = 0.34", "controller.gamma=1", "sensor.min_z=0", "controller.gamma=2"]
    assert parse_assignments(texts) == {
        "controller": {"grid": {"extent": 0.34}, "gamma": 2},
        "sensor": {"min_z": 0},
    }
    assert parse_assignments([]) == {}


@pytest.mark.parametrize("text", ["gamma=1", "controller.gamma", "controller.=1", ".gamma=1", "=1", "a..b=1"])
def test_what_is_no_assignment_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=r"unusable --set; got .*allowed: --set GROUP.KEY=VALUE"):
        parse_assignments([text])


def test_a_value_is_no_table() -> None:
    with pytest.raises(ConfigError, match=r"--set controller\.grid\.cell: grid has a value already"):
        parse_assignments(["controller.grid=1", "controller.grid.cell=2"])
    with pytest.raises(ConfigError, match=r"--set controller\.grid: keys within grid are set already"):
        parse_assignments(["controller.grid.cell=2", "controller.grid=1"])
