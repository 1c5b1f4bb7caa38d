"""Pose moves keep the joints' limits near a singularity, and lose no time elsewhere."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.ik import DifferentialIK, solve_pose
from mpgrasp.motion.time_scaling import rehearse, slowdown
from mpgrasp.motion.trajectory import MotionConfig, path_profile, pose_error
from mpgrasp.robot.panda import DDQ_MAX, DQ_MAX, Q_HOME
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.simulation import Simulation

UNSCALED = MotionConfig(max_slowdown=1.0)
NEAR_BASE = ((0.333, 0.093, 0.170), (0.363, 0.090, 0.060), -1.417)
"""Start, end [m] and yaw [rad] of a move during which the smallest singular value falls to 0.07."""


@cache
def scene() -> Scene:
    return build_scene(SceneConfig(cloth_unevenness=0.0, centre=(0.6, -0.2), half_extent=0.01), 0)


def move(
    start: tuple[float, ...], end: tuple[float, ...], yaw: float, turn: float, config: MotionConfig
) -> ArmDriver:
    simulation = Simulation(scene())
    simulation.set_q(solve_pose(simulation.q, looking_down(start, yaw)))
    driver = ArmDriver(simulation, config)
    driver.move_to(looking_down(end, yaw + turn))
    return driver


def test_a_move_past_a_singularity_keeps_every_joint_within_its_limits() -> None:
    start, end, yaw = NEAR_BASE
    # at full speed the same way ends in a stop
    assert move(start, end, yaw, 0.0, UNSCALED).reflex is not None
    driver = move(start, end, yaw, 0.0, MotionConfig())
    statistics = driver.statistics()
    assert driver.reflex is None
    assert statistics.min_singular_value < 0.08
    assert np.all(statistics.max_joint_velocity < 0.9 * DQ_MAX)
    assert np.all(statistics.max_joint_acceleration < 0.9 * DDQ_MAX)
    np.testing.assert_allclose(driver.T_desired[:3, 3], end, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_moves_within_the_workspace_keep_their_duration(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low, high = [0.42, -0.15, 0.08], [0.62, 0.15, 0.30]
    start, end = rng.uniform(low, high), rng.uniform(low, high)
    turn = float(rng.uniform(-1, 1))
    driver = move(tuple(start), tuple(end), 0.0, turn, MotionConfig())
    c = driver.config
    ticks = len(path_profile(float(np.linalg.norm(end - start)), abs(turn), c, c.max_speed, c.max_rotation))
    assert driver.statistics().duration == pytest.approx(ticks * c.dt)


def test_a_twist_is_never_slowed_down() -> None:
    start, end, yaw = NEAR_BASE
    simulation = Simulation(scene())
    simulation.set_q(solve_pose(simulation.q, looking_down(start, yaw)))
    driver = ArmDriver(simulation)
    way = np.subtract(end, start)
    # what the closed loop asks for is what the stop judges
    reflex = driver.drive(np.concatenate([0.25 * way / np.linalg.norm(way), np.zeros(3)]), 1.0)
    assert reflex is not None
    assert reflex.limit in ("joint_velocity", "joint_acceleration")


def test_a_slower_profile_takes_as_many_times_as_long_and_still_ends_at_one() -> None:
    c = MotionConfig(smoothing=1)
    for length in (0.3, 0.01):
        quick, slow = (path_profile(length, 0.2, c, 0.25, 1.5, k) for k in (1.0, 3.0))
        assert len(slow) == pytest.approx(3 * len(quick), abs=3)
        assert slow[-1] == pytest.approx(1.0)
        # a third of the velocity, a ninth of the acceleration
        assert np.diff(slow).max() == pytest.approx(np.diff(quick).max() / 3, rel=0.05)
        assert np.diff(slow, n=2).max() == pytest.approx(np.diff(quick, n=2).max() / 9, rel=0.05)


def test_a_rehearsal_ends_at_the_pose_and_leaves_the_arm_alone() -> None:
    ik, q = DifferentialIK(), np.array(Q_HOME)
    start, target = ik.pose(q), looking_down((0.55, 0.15, 0.2), 0.8)
    path = rehearse(ik, q, start, pose_error(start, target), np.linspace(0.02, 1.0, 50))
    np.testing.assert_allclose(ik.pose(path[-1]), target, atol=1e-3)
    np.testing.assert_array_equal(q, Q_HOME)


def test_slowing_down_is_bounded_and_needs_a_way_to_go() -> None:
    ik, q, c = DifferentialIK(), np.array(Q_HOME), MotionConfig(max_slowdown=2.5)
    start = ik.pose(q)
    assert slowdown(ik, q, start, np.zeros(6), np.empty(0), c) == 1.0
    # out to where no arm reaches
    far = np.array([0.6, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert slowdown(ik, q, start, far, path_profile(0.6, 0.0, c, 0.25, 1.5), c) == 2.5


def test_unusable_time_scaling_is_refused() -> None:
    for bad in ({"joint_fraction": 0.0}, {"joint_fraction": 1.1}, {"max_slowdown": 0.9}):
        with pytest.raises(ConfigError):
            MotionConfig(**bad)  # type: ignore[arg-type]
