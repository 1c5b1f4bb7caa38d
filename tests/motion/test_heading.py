"""The hand turns the short way to a grasp, unless only the other heading is in reach."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.motion.heading import nearest_yaw, reachable_yaw

GRASP = Grasp(position=np.array([0.5, 0.0, 0.02]), angle=0.3, width=0.03, quality=1.0)


def driver_that_reaches(low: float, high: float) -> Any:
    """A driver at heading 1.5 whose kinematics reach headings between two bounds only [rad]."""

    def solve(_: FloatArray, T: FloatArray) -> FloatArray:
        if not low < np.arctan2(T[1, 0], T[0, 0]) < high:
            raise ConfigError("tool pose is out of reach")
        return np.zeros(7)

    return SimpleNamespace(
        T_desired=looking_down([0.5, 0.0, 0.4], 1.5), q=np.zeros(7), ik=SimpleNamespace(solve=solve)
    )


def test_the_nearest_yaw_is_the_same_line_within_a_quarter_turn() -> None:
    rng = np.random.default_rng(0)
    for angle, yaw in rng.uniform(-4, 4, (100, 2)):
        near = nearest_yaw(angle, yaw)
        assert abs(near - yaw) <= np.pi / 2 + 1e-12
        assert line_angle_difference(near, angle) < 1e-9


@pytest.mark.parametrize(
    ("low", "high", "yaw"),
    [
        (-4.0, 4.0, 0.3 + np.pi / 2),  # both: the nearer one
        (0.0, 4.0, 0.3 + np.pi / 2),
        (-4.0, 0.0, 0.3 - np.pi / 2),  # only the far one
        (8.0, 9.0, 0.3 + np.pi / 2),  # neither: let the protective stop say why
    ],
)
def test_the_far_heading_is_taken_only_where_the_near_one_is_out_of_reach(
    low: float, high: float, yaw: float
) -> None:
    assert reachable_yaw(driver_that_reaches(low, high), GRASP) == pytest.approx(yaw)
