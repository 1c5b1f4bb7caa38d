"""Laws of grids of settings."""

from __future__ import annotations

from itertools import product

import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.settings.assignment import parse_assignments
from mpgrasp.settings.grid import LIMIT, parse_grid, split_values


@pytest.mark.parametrize(
    ("text", "items"),
    [
        ("0,4/3,8", ["0", "4/3", "8"]), (" a , b ", ["a", "b"]),
         ("1", ["1"]), ("", [""]), ("1,,2", ["1", "", "2"]),
        ("[0, pi/2],[0.1, 0]", ["[0, pi/2]", "[0.1, 0]"]), ("{a = 1, b = 2}", ["{a = 1, b = 2}"]),
        ("(1 + 2),3", ["(1 + 2)", "3"]), ('"a,b",c', ['"a,b"', "c"]), ("'[',1", ["'['", "1"]),
        ("[[0, 0], [1, 1]]", ["[[0, 0], [1, 1]]"]),
    ],
)  # fmt: skip
def test_commas_divide_values_outside_of_brackets_and_quotes(text: str, items: list[str]) -> None:
    assert list(split_values(text)) == items


def test_a_grid_is_the_product_of_its_values_with_the_last_setting_changing_first() -> None:
    grid = parse_grid(["controller.gamma=0,4/3", "sensor.subpixel = 0.1", "controller.choice=grid, pool"])
    points = list(grid.points())
    assert [point.texts for point in points] == list(product(("0", "4/3"), ("grid", "pool")))
    assert points[1].label == "gamma=0,choice=pool"
    assert parse_assignments(points[2].assignments) == {
        "controller": {"gamma": 4 / 3, "choice": "grid"},
        "sensor": {"subpixel": 0.1},
    }
    assert [axis.values for axis in grid.axes] == [(0, 4 / 3), ("grid", "pool")]


def test_a_name_is_the_shortest_end_that_no_other_setting_has() -> None:
    grid = parse_grid(
        ["camera.intrinsics.cx=1,2", "camera.crop=1,2", "detector.crop=1,2", "controller.grid.cell=1,2"]
    )
    assert [axis.name for axis in grid.axes] == ["cx", "camera.crop", "detector.crop", "cell"]


def test_an_episode_s_group_has_one_name() -> None:
    with pytest.raises(ConfigError, match=r"execution\.lift is given twice"):
        parse_grid(["execution.lift=0.1,0.2", "episode.execution.lift=0.1"])


def test_ten_settings_with_two_values_each_make_a_grid_and_eleven_are_too_many() -> None:
    texts = [f"controller.k{n}=0,1" for n in range(10)]
    points = list(parse_grid(texts).points())
    assert len({point.label for point in points}) == len(points) == 2**10 == LIMIT
    with pytest.raises(
        ConfigError, match="too many points in the grid of a sweep; got 2048; allowed: up to 1024"
    ):
        parse_grid([*texts, "controller.k10=0,1"])


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ([], "no setting with several values"),
        (["controller.gamma=1"], "no setting with several values"),
        (["gamma=1,2"], "unusable --set; got 'gamma=1,2'"),
        (["controller.gamma"], "unusable --set"),
        (["controller.gamma=1,2", "controller.gamma=3"],
         r"controller\.gamma is given twice; got 'controller\.gamma=3'"),
        (["controller.gamma=1,"], r"controller\.gamma has an empty value; got '1,'"),
        (["controller.gamma="], "has an empty value"),
        (["controller.gamma=1,1.0,2,1"], "has a value twice; got '1.0'"),
        (["controller.gamma=4/3,0.2/0.15"], "has a value twice; got '0.2/0.15'"),
        (["controller.gamma=1,4/3m"], r"controller\.gamma is unusable; got '4/3m'"),
        (["controller.gamma=1,[2"], r"controller\.gamma is unusable; got '\[2'"),
    ],
)  # fmt: skip
def test_what_is_no_grid_is_refused(texts: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse_grid(texts)
