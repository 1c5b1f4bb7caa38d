"""Laws of settings that are declared as tables."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.files.settings import from_table, merged


@dataclass(frozen=True, kw_only=True)
class Hand:
    force: float = 40.0
    fingers: int = 2

    def __post_init__(self) -> None:
        if self.force < 0:
            raise ConfigError("force must not be negative", got=self.force)


@dataclass(frozen=True, kw_only=True)
class Robot:
    name: str
    home: tuple[float, float] = (0.0, 0.5)
    stops: tuple[tuple[float, float], ...] = ()
    grip: Literal["pinch", "suction"] = "pinch"
    retries: int | None = None
    quiet: bool = False
    hand: Hand = field(default_factory=lambda: Hand(force=10.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Joints:
    limits: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))


def robot(toml: str) -> Robot:
    return from_table(Robot, tomllib.loads(toml), "robot")


def test_what_a_table_names_is_set_and_the_rest_is_the_default() -> None:
    made = robot(
        "name = 'a'\nhome = [1, 2.5]\nstops = [[0.1, 0.2], [3, 4]]\n"
        "grip = 'suction'\nretries = 2\nquiet = true"
    )
    assert made == Robot(
        name="a", home=(1.0, 2.5), stops=((0.1, 0.2), (3.0, 4.0)), grip="suction", retries=2, quiet=True
    )
    assert type(made.home[0]) is float
    assert robot("name = 'a'") == Robot(name="a")


def test_a_table_within_keeps_the_default_of_its_field_and_not_that_of_its_class() -> None:
    assert robot("name = 'a'\nhand.fingers = 3").hand == Hand(force=10.0, fingers=3)


def test_defaults_can_be_those_of_another_config() -> None:
    base = Robot(name="base", retries=1, hand=Hand(force=5.0))
    made = from_table(Robot, {"quiet": True, "hand": {"fingers": 4}}, "robot", base)
    assert made == Robot(name="base", retries=1, quiet=True, hand=Hand(force=5.0, fingers=4))


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        ("", "robot, name is missing; allowed: a text"),
        ("name = 1", "robot, name is unusable; got 1; allowed: a text"),
        ("name = 'a'\nhomes = []", "robot: unknown key; got 'homes'; allowed: name, home, stops"),
        ("name = 'a'\nhome = [1]", r"home is unusable; got \[1\]; allowed: a value such as \(0.0, 0.5\)"),
        ("name = 'a'\nhome = [1, 'x']", "robot, home is unusable"),
        ("name = 'a'\nstops = [1]", "robot, stops is unusable; got .1.; allowed: a list"),
        ("name = 'a'\nstops = [[0, nan]]", "robot, stops is not finite"),
        ("name = 'a'\ngrip = 'glue'", "robot, grip is unusable; got 'glue'; allowed: pinch, suction"),
        ("name = 'a'\nretries = true", "robot, retries is unusable; got True; allowed: a whole number"),
        ("name = 'a'\nretries = 2.0", "robot, retries is unusable; got 2.0"),
        ("name = 'a'\nquiet = 1", "robot, quiet is unusable; got 1; allowed: a value such as False"),
        ("name = 'a'\nhand = 1", "robot, hand is not a table; got 1; allowed: force, fingers"),
        ("name = 'a'\nhand.force = -inf", "force is not finite; got -inf; allowed: a value such as 10.0"),
        ("name = 'a'\nhand.force = true", "robot, hand, force is unusable; got True"),
        ("name = 'a'\nhand.force = -1", "robot, hand: force must not be negative; got -1.0"),
        ("name = 'a'\nhand.thumb = 1", "robot, hand: unknown key; got 'thumb'; allowed: force, fingers"),
    ],
)  # fmt: skip
def test_an_error_names_the_place_what_came_and_what_is_allowed(toml: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        robot(toml)


def test_what_is_no_table_is_refused() -> None:
    with pytest.raises(ConfigError, match="robot is not a table; got 3; allowed: name, home"):
        from_table(Robot, 3, "robot")


def test_what_is_an_array_by_default_becomes_one() -> None:
    made = from_table(Joints, {"limits": [1, 2.5]}, "joints")
    assert isinstance(made.limits, np.ndarray)
    assert made.limits.tolist() == [1.0, 2.5]
    for limits in ([1, math.nan], "wide", [[1, 2], [3, 4]], [True, 1]):
        with pytest.raises(ConfigError, match="joints, limits"):
            from_table(Joints, {"limits": limits}, "joints")


def test_tables_are_merged_key_by_key_and_leave_their_own_as_they_are() -> None:
    table = {"a": 1, "b": {"c": 2, "d": 3}}
    assert merged(table, {"b": {"c": 4}, "e": {"f": 5}}) == {"a": 1, "b": {"c": 4, "d": 3}, "e": {"f": 5}}
    assert table == {"a": 1, "b": {"c": 2, "d": 3}}
    assert merged({"a": {"b": 1}}, {"a": 2}) == {"a": 2}


def test_a_config_made_in_python_may_hold_what_a_file_may_not() -> None:
    base = Robot(name="a", home=(math.inf, 0.0))
    assert from_table(Robot, {}, "robot", base) == base
