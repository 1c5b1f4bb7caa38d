"""Ramps bound what they promise, ordinary motion trips nothing, impossible motion ends in a named stop."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down, rotation_vector
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.ik import solve_pose
from mpgrasp.motion.trajectory import MotionConfig, TwistRamp, path_profile
from mpgrasp.robot.panda import DDQ_MAX, DQ_MAX
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.simulation import Simulation


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(SceneConfig(), 0)


def driver_at(scene: Scene, x: float, y: float, z: float, yaw: float = 0.0) -> ArmDriver:
    simulation = Simulation(scene)
    simulation.set_q(solve_pose(simulation.q, looking_down([x, y, z], yaw)))
    return ArmDriver(simulation)


def wandering_twists(seed: int, n: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-1, 1, (n // 10, 6)) * [0.3, 0.3, 0.3, 2, 2, 2], 10, axis=0)


def test_a_ramped_twist_obeys_acceleration_and_jerk_bounds() -> None:
    config = MotionConfig()
    ramp = TwistRamp(config)
    twists = np.array([ramp.step(twist) for twist in wandering_twists(0, 400)])
    acceleration = np.diff(twists, axis=0) / config.dt
    jerk = np.diff(acceleration, axis=0) / config.dt
    window = config.smoothing * config.dt
    for part, bound in (
        (slice(0, 3), config.linear_acceleration),
        (slice(3, 6), config.angular_acceleration),
    ):
        assert np.linalg.norm(acceleration[:, part], axis=1).max() <= bound * (1 + 1e-9)
        assert np.linalg.norm(jerk[:, part], axis=1).max() <= 2 * bound / window * (1 + 1e-9)


def test_a_ramp_reaches_its_twist_without_overshoot_and_stays() -> None:
    config = MotionConfig()
    ramp = TwistRamp(config)
    wanted = np.array([0.1, 0, 0, 0, 0, 0.4])
    twists = np.array([ramp.step(wanted) for _ in range(30)])
    assert np.all(twists <= wanted + 1e-12)
    assert np.all(np.diff(twists, axis=0) >= -1e-12)
    # 0.1 m/s at 1 m/s2 is 10 ticks, and the mean lags by one window
    np.testing.assert_allclose(twists[10 + config.smoothing :], np.broadcast_to(wanted, (15, 6)), atol=1e-12)


@pytest.mark.parametrize(("length", "angle"), [(0.3, 0.0), (0.3, 1.5), (0.01, 0.0), (0.002, 1.0), (0.0, 0.5)])
def test_a_path_profile_rises_to_one_within_its_bounds(length: float, angle: float) -> None:
    config = MotionConfig()
    share = np.concatenate([[0.0], path_profile(length, angle, config, 0.25, 1.5)])
    assert share[-1] == pytest.approx(1.0)
    velocity = np.diff(share) / config.dt
    acceleration = np.diff(np.concatenate([[0.0], velocity, [0.0]])) / config.dt
    assert np.all(velocity >= 0)
    # the whole path is scaled so that it ends exactly: allow that rounding
    for size, speed, bound in ((length, 0.25, 1.0), (angle, 1.5, 4.0)):
        assert (velocity * size).max() <= speed * 1.03
        assert np.abs(acceleration * size).max() <= bound * 1.03


def test_a_path_of_no_length_has_no_ticks() -> None:
    assert len(path_profile(0.0, 0.0, MotionConfig(), 0.25, 1.5)) == 0


def test_a_straight_reach_and_its_reversals_trip_nothing(scene: Scene) -> None:
    driver = driver_at(scene, 0.45, 0.0, 0.5)
    for k in range(65):
        lateral = 0.1 * (-1) ** (k // 5)
        twist = np.array([lateral, 0.1 * (-1) ** (k // 3), -0.05, 0, 0, 0.5 * (-1) ** (k // 4)])
        assert driver.drive(twist, 0.1) is None
    driver.stop()
    assert driver.simulation.T_world_tcp[2, 3] == pytest.approx(0.175, abs=0.003)
    statistics = driver.statistics()
    assert statistics.max_tracking_error < 0.003
    assert statistics.max_acceleration <= 1.0 + 1e-6
    # far from the stops, not just short of them
    assert np.all(statistics.max_joint_velocity < 0.6 * DQ_MAX)
    assert np.all(statistics.max_joint_acceleration < 0.6 * DDQ_MAX)


def test_path_length_and_jerk_are_those_of_the_measured_path(scene: Scene) -> None:
    driver = driver_at(scene, 0.5, 0.0, 0.4)
    positions, velocities = [driver.simulation.T_world_tcp[:3, 3]], []

    def watch(driver: ArmDriver) -> None:
        positions.append(driver.simulation.T_world_tcp[:3, 3])
        velocities.append(driver.simulation.twist_tcp[:3])

    driver.drive(np.array([0.08, -0.05, 0, 0, 0, 0]), 1.0, watch)
    statistics = driver.statistics()
    assert len(positions) == 101
    length = np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()
    assert statistics.path_length == pytest.approx(length)
    jerk = np.diff(velocities, n=2, axis=0) / 0.01**2
    assert statistics.jerk_rms == pytest.approx(np.sqrt((jerk**2).sum(axis=1).mean()))
    assert statistics.duration == pytest.approx(1.0)
    # and the path is what the twist asks for, less what the ramp takes
    assert length == pytest.approx(np.hypot(0.08, 0.05) * (1.0 - 0.5 * 0.094 - 0.02), abs=0.003)


@pytest.mark.parametrize("heading", [0.0, 0.6])
def test_driving_outwards_ends_in_a_named_stop(scene: Scene, heading: float) -> None:
    driver = driver_at(scene, 0.5, 0.0, 0.3)
    twist = np.array([0.1 * np.cos(heading), 0.1 * np.sin(heading), 0, 0, 0, 0])
    reflex = driver.drive(twist, 10.0)
    assert reflex is not None
    assert reflex.limit in ("joint_velocity", "joint_acceleration")
    assert reflex.joint is not None
    assert abs(reflex.value) > abs(reflex.bound)
    # the warning comes before the stop
    assert driver.statistics().near_singularity > 0
    assert np.linalg.norm(driver.simulation.T_world_tcp[:2, 3]) > 0.7


def test_a_stopped_arm_stays_where_it_stopped(scene: Scene) -> None:
    driver = driver_at(scene, 0.7, 0.0, 0.3)
    reflex = driver.drive(np.array([0.1, 0, 0, 0, 0, 0]), 5.0)
    time = driver.simulation.time
    assert reflex is not None
    assert driver.drive(np.array([-0.1, 0, 0, 0, 0, 0]), 1.0) is reflex
    assert not driver.move_to(looking_down([0.5, 0, 0.3]))
    assert driver.wait(0.5) is reflex
    assert driver.simulation.time == time
    driver.simulation.step(250)
    assert np.linalg.norm(driver.simulation.dq) < 0.01


def test_winding_up_the_wrist_ends_in_a_named_stop(scene: Scene) -> None:
    driver = driver_at(scene, 0.5, 0.0, 0.3)
    reflex = driver.drive(np.array([0, 0, 0, 0, 0, -1.0]), 12.0)
    assert reflex is not None
    assert reflex.joint is not None


@pytest.mark.parametrize(
    ("position", "yaw"), [((0.6, 0.2, 0.1), 1.0), ((0.4, -0.2, 0.05), -1.5), ((0.5, 0, 0.3), 0.0)]
)
def test_a_move_ends_at_its_pose(scene: Scene, position: tuple[float, ...], yaw: float) -> None:
    driver = driver_at(scene, 0.45, 0.05, 0.4)
    target = looking_down(position, yaw)
    assert driver.move_to(target)
    driver.wait(0.3)
    T = driver.simulation.T_world_tcp
    assert np.linalg.norm(T[:3, 3] - target[:3, 3]) < 1e-3
    assert np.degrees(np.linalg.norm(rotation_vector(T[:3, :3].T @ target[:3, :3]))) < 0.5
    assert np.linalg.norm(driver.simulation.twist_tcp[:3]) < 1e-3


def test_a_move_is_straight(scene: Scene) -> None:
    driver = driver_at(scene, 0.4, -0.1, 0.4)
    start, target = driver.T_desired[:3, 3], looking_down([0.55, 0.15, 0.15], 0.8)
    along = (target[:3, 3] - start) / np.linalg.norm(target[:3, 3] - start)
    off: list[float] = []

    def watch(driver: ArmDriver) -> None:
        way = driver.simulation.T_world_tcp[:3, 3] - start
        off.append(float(np.linalg.norm(way - (way @ along) * along)))

    driver.move_to(target, on_tick=watch)
    assert max(off) < 1e-3


def test_a_guarded_move_stops_within_a_millimetre_of_contact(scene: Scene) -> None:
    driver = driver_at(scene, 0.4, 0.2, 0.03)
    reached = driver.move_to(
        looking_down([0.4, 0.2, -0.02]), 0.02, until=lambda: driver.touch > 3.0, deceleration=1.0
    )
    assert not reached
    assert driver.reflex is None
    driver.wait(0.1)
    assert driver.touch < 15.0
    assert driver.simulation.T_world_tcp[2, 3] - driver.T_desired[2, 3] < 1e-3


def test_pressing_on_ends_in_a_contact_force_stop(scene: Scene) -> None:
    driver = driver_at(scene, 0.4, 0.2, 0.03)
    driver.move_to(looking_down([0.4, 0.2, -0.03]), 0.05)
    assert driver.reflex is not None
    assert driver.reflex.limit in ("contact_force", "tracking_position")


def test_shaking_returns_to_where_it_began(scene: Scene) -> None:
    driver = driver_at(scene, 0.5, 0.0, 0.3)
    before = driver.T_desired.copy()
    driver.follow(lambda t: np.array([0.005 * np.sin(np.pi * t) ** 3, 0, 0]), 1.0)
    assert driver.reflex is None
    np.testing.assert_allclose(driver.T_desired, before, atol=1e-9)


@pytest.mark.parametrize("bad", [{"dt": 0.0}, {"smoothing": 0}, {"max_speed": -1.0}])
def test_unusable_settings_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        MotionConfig(**bad)  # type: ignore[arg-type]


def test_a_period_that_physics_cannot_divide_is_refused(scene: Scene) -> None:
    with pytest.raises(ConfigError, match="multiple"):
        ArmDriver(Simulation(scene), MotionConfig(dt=0.011))
