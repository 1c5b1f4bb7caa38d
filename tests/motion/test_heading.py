"""The hand turns the short way to a grasp, unless only the other heading is in reach."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.motion import heading
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.heading import nearest_yaw, reachable_yaw
from mpgrasp.motion.ik import solve_pose
from mpgrasp.robot import hand, panda
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import build_scene
from mpgrasp.scene.simulation import Simulation

GRASP = Grasp(position=np.array([0.5, 0.0, 0.02]), angle=0.3, width=0.03, quality=1.0)


def driver_that_reaches(low: float, high: float) -> Any:
    """A driver at heading 1.5 whose kinematics reach headings between two bounds only [rad]."""

    def solve(_: FloatArray, T: FloatArray) -> FloatArray:
        if not low < np.arctan2(T[1, 0], T[0, 0]) < high:
            raise ConfigError("tool pose is out of reach")
        return np.zeros(7)

    start = looking_down([0.5, 0.0, 0.4], 1.5)
    kinematics = SimpleNamespace(
        solve=solve, pose=lambda _: start, jacobian=lambda _: np.zeros((6, 7)), room=np.ones_like
    )
    return SimpleNamespace(T_desired=start, q=np.zeros(7), ik=kinematics)


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


def driver_at(start: tuple[float, float, float], yaw: float) -> ArmDriver:
    scene = build_scene(SceneConfig(cloth_unevenness=0.0, centre=(0.6, -0.2), half_extent=0.01), 0)
    simulation = Simulation(scene)
    simulation.set_q(solve_pose(simulation.q, looking_down(start, yaw)))
    return ArmDriver(simulation)


def approach(driver: ArmDriver, grasp: Grasp, yaw: float) -> None:
    """The straight moves of an execution: over the grasp, down and up again."""
    c, (x, y, z) = ExecutionConfig(), grasp.position
    driver.move_to(looking_down([x, y, z + c.approach], yaw), c.approach_speed)
    driver.move_to(looking_down([x, y, hand.FINGERTIP_BEYOND_TCP], yaw), c.descent_speed)
    driver.wait(1.0)
    driver.move_to(looking_down([x, y, hand.FINGERTIP_BEYOND_TCP + c.lift], yaw), c.lift_speed)


WINDING = Grasp(position=np.array([0.463, -0.089, 0.005]), angle=-0.777, width=0.03, quality=1.0)
"""After the shorter turn to it from a heading of -1.11, the wrist meets its limit on the way up."""


def driver_after_a_reach(
    q: tuple[float, ...] = (-0.095, 0.349, -0.123, -2.03, 0.06, 2.375, 1.641),
) -> ArmDriver:
    driver = driver_at((0.585, -0.127, 0.172), -1.11)
    driver.simulation.set_q(np.array(q))
    driver.reset()
    return driver


def test_a_turn_that_would_wind_the_wrist_up_to_its_margin_is_made_the_other_way() -> None:
    driver = driver_after_a_reach()
    near = nearest_yaw(WINDING.angle + np.pi / 2, -1.11)
    driver.ik.solve(driver.q, looking_down(WINDING.position, near))  # the pose itself has a posture
    yaw = reachable_yaw(driver, WINDING)
    assert yaw == pytest.approx(near + np.pi)
    approach(driver, WINDING, yaw)
    assert driver.reflex is None
    assert abs(driver.q[6]) < panda.Q_MAX[6] - 0.5


def test_the_turn_that_was_not_taken_ends_in_a_stop_that_names_the_wrist() -> None:
    driver = driver_after_a_reach()
    approach(driver, WINDING, nearest_yaw(WINDING.angle + np.pi / 2, -1.11))
    assert driver.reflex is not None
    assert (driver.reflex.limit, driver.reflex.joint) == ("joint_position", 7)


FOLDED = (0.4116, -0.3479, 0.4467, -2.8671, 0.2613, 2.5349, 0.9826)
"""Joint positions over the near edge of the table: the elbow is close to its limit whatever the heading."""


def test_where_neither_heading_keeps_clear_the_one_that_comes_less_close_is_taken() -> None:
    grasp = Grasp(position=np.array([0.2416, 0.197, 0.01]), angle=0.5455, width=0.03, quality=1.0)
    near = nearest_yaw(grasp.angle + np.pi / 2, 0.42)
    stops = {}
    for yaw in (near, near + np.pi):
        driver = driver_after_a_reach(FOLDED)
        approach(driver, grasp, yaw)
        stops[yaw] = driver.reflex
    assert stops[near] is not None
    assert stops[near + np.pi] is None
    driver = driver_after_a_reach(FOLDED)
    assert not any(heading._spare_room(driver, grasp, ExecutionConfig(), yaw) >= 0 for yaw in stops)
    assert reachable_yaw(driver, grasp) == pytest.approx(near + np.pi)


def test_the_heading_that_is_chosen_is_reached_without_a_stop_wherever_the_reach_ended() -> None:
    rng = np.random.default_rng(3)
    for _ in range(6):
        x, y = rng.uniform(0.42, 0.6), rng.uniform(-0.12, 0.12)
        driver = driver_at((x, y, 0.175), float(rng.uniform(-1.5, 1.5)))
        spot = np.array([x, y, 0.005]) + np.append(rng.uniform(-0.06, 0.06, 2), 0.0)
        grasp = Grasp(position=spot, angle=float(rng.uniform(-1.5, 1.5)), width=0.03, quality=1.0)
        approach(driver, grasp, reachable_yaw(driver, grasp))
        assert driver.reflex is None, str(driver.reflex)
