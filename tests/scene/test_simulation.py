"""Physics that can be trusted: time, servo, gripper, contacts and state."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from box_scenes import CENTRE, KINEMATICS, box_scene, contact_force, grasp, put, travel

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import invert, looking_down, rotation_vector
from mpgrasp.robot import hand, panda
from mpgrasp.scene.simulation import SERVO_PERIOD, Simulation

SIZES = [(0.06, 0.03, 0.04), (0.06, 0.008, 0.008), (0.06, 0.0045, 0.0045), (0.06, 0.07, 0.05)]


@pytest.mark.parametrize("size", SIZES, ids=lambda s: f"{s[1] * 1000:g}mm")
@pytest.mark.parametrize("offset", [0.0, 0.004])
def test_box_is_lifted_whatever_its_thickness(size: tuple[float, float, float], offset: float) -> None:
    sim = Simulation(box_scene(size, mass=0.02))
    grasp(sim, size, hand.GRIPPER_FORCE_DEFAULT, offset)
    assert sim.object_pose("box_0")[2, 3] == pytest.approx(size[2] / 2 + 0.1, abs=0.004)
    assert sim.held() == {"box_0"}
    assert sim.gripper_width == pytest.approx(size[1], abs=0.0005)


@pytest.mark.parametrize("force", [30.0, 70.0])
@pytest.mark.parametrize("size", [SIZES[0], SIZES[2]], ids=lambda s: f"{s[1] * 1000:g}mm")
def test_grip_settles_at_the_force_asked_for_and_holds(
    size: tuple[float, float, float], force: float
) -> None:
    mass = 0.02
    sim = Simulation(box_scene(size, mass=mass))
    grasp(sim, size, force)
    assert contact_force(sim) == pytest.approx(force, abs=1.0)
    held = invert(sim.T_world_tcp) @ sim.object_pose("box_0")
    sim.step(5000)
    crept = invert(sim.T_world_tcp) @ sim.object_pose("box_0") - held
    assert np.linalg.norm(crept[:3, 3]) < 2e-4
    assert contact_force(sim) == pytest.approx(force, abs=1.0)
    # the grip cancels in what the arm feels: only the weight is left
    np.testing.assert_allclose(sim.external_force, [0, 0, -mass * 9.81], atol=0.02)


def test_released_object_falls() -> None:
    sim = Simulation(box_scene(SIZES[0]))
    grasp(sim, SIZES[0], 40.0)
    sim.open_gripper(0.06)
    sim.step(300)
    assert sim.finger_forces() == {}
    assert sim.object_pose("box_0")[2, 3] == pytest.approx(0.02, abs=1e-3)


@pytest.mark.parametrize("force", [40.0, 70.0])
def test_fingers_stay_within_their_limits_when_nothing_is_between(force: float) -> None:
    sim = Simulation(box_scene())
    sim.close_gripper(force)
    fingers = []
    for _ in range(250):
        sim.step(10)
        fingers.append(sim.data.qpos[[7, 8]])
    assert np.min(fingers) > -2e-4
    assert np.ptp(fingers, axis=1).max() < 1e-5  # mirrored
    assert sim.gripper_width == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("width", [0.0, 0.02, 0.05, 0.08, 0.2])
def test_gripper_opens_to_the_commanded_width_at_a_realistic_speed(width: float) -> None:
    sim = Simulation(box_scene())
    sim.open_gripper(0.04)
    sim.step(500)
    sim.open_gripper(width)
    widths = []
    for _ in range(100):
        sim.step(5)
        widths.append(sim.gripper_width)
    assert widths[-1] == pytest.approx(min(width, hand.GRIPPER_MAX_WIDTH), abs=1e-5)
    assert np.abs(np.diff(widths)).max() / 0.01 < 1.05 * hand.GRIPPER_SPEED


@pytest.mark.parametrize("force", [0.0, 29.0, 71.0, float("nan")])
def test_impossible_grip_force_is_refused(force: float) -> None:
    with pytest.raises(ConfigError, match="30"):
        Simulation(box_scene()).close_gripper(force)


def test_arm_tracks_a_straight_line_and_stops_on_the_spot() -> None:
    sim = Simulation(box_scene())
    start, end = np.array([0.35, -0.25, 0.35]), np.array([0.6, 0.2, 0.15])
    q = put(sim, *start)
    _, worst = travel(sim, q, start, end, 0.1)
    assert worst < 1.2e-3
    np.testing.assert_allclose(sim.T_world_tcp[:3, 3], end, atol=2e-4)
    sim.step(250)
    np.testing.assert_allclose(sim.T_world_tcp[:3, 3], end, atol=1e-5)
    np.testing.assert_allclose(sim.twist_tcp, 0, atol=1e-5)


def test_gravity_does_not_make_the_arm_sag_and_counts_as_torque() -> None:
    sim = Simulation(box_scene())
    q = put(sim, 0.6, 0.1, 0.2)
    sim.step(2500)
    np.testing.assert_allclose(sim.q, q, atol=1e-9)
    gravity = sim.data.qfrc_bias[:7]
    assert np.abs(gravity).max() > 10
    np.testing.assert_allclose(sim.data.qfrc_actuator[:7], gravity, atol=1e-6)


def test_arm_stops_when_commands_cease() -> None:
    sim = Simulation(box_scene())
    target = panda.Q_HOME + np.array([0.002, 0, 0, 0, 0, 0, 0])
    sim.set_arm_target(target, np.array([0.2, 0, 0, 0, 0, 0, 0]))
    sim.step(500)
    np.testing.assert_allclose(sim.q, target, atol=1e-6)


def test_targets_beyond_a_joint_limit_are_cut() -> None:
    sim = Simulation(box_scene())
    q = panda.Q_HOME.copy()
    q[6] = 2.8
    sim.set_q(q)
    for k in range(100):
        sim.set_arm_target(q + np.array([0, 0, 0, 0, 0, 0, 0.005 * k]), np.array([0, 0, 0, 0, 0, 0, 0.5]))
        sim.step(5)
    assert sim.q[6] == pytest.approx(panda.Q_MAX[6], abs=2e-3)


def test_twist_is_the_rate_of_change_of_the_pose() -> None:
    sim = Simulation(box_scene())
    q, dq = panda.Q_HOME.copy(), np.array([0.1, -0.05, 0.08, 0.1, -0.1, 0.06, 0.2])
    for _ in range(60):
        q = q + dq * SERVO_PERIOD
        sim.set_arm_target(q, dq)
        sim.step(5)
    sim.set_arm_target(q + dq * SERVO_PERIOD, dq)
    sim.step(1)
    before, twist = sim.T_world_tcp, sim.twist_tcp
    sim.step(1)
    after = sim.T_world_tcp
    twist = (twist + sim.twist_tcp) / 2
    dt = sim.model.opt.timestep
    np.testing.assert_allclose(twist[:3], (after - before)[:3, 3] / dt, atol=2e-3)
    turn = rotation_vector(after[:3, :3] @ before[:3, :3].T)
    np.testing.assert_allclose(twist[3:], turn / dt, atol=5e-3)
    np.testing.assert_allclose(sim.dq, dq, atol=0.01)


def test_touching_down_at_descent_speed_is_felt_but_mild() -> None:
    sim = Simulation(box_scene())
    q = put(sim, 0.5, 0.0, 0.03)
    assert contact_force(sim) == 0
    z, peak = 0.03, 0.0
    for _ in range(100):
        if peak < 3:  # the arm stops where it feels the table
            z -= 0.05 * SERVO_PERIOD
        target = KINEMATICS.solve(looking_down((0.5, 0.0, z)), q)
        sim.set_arm_target(target, (target - q) / SERVO_PERIOD)
        q = target
        sim.step(5)
        peak = max(peak, float(sim.external_force[2]))
    assert 5 < peak < 40
    assert sim.finger_forces() == {}


def test_external_force_is_what_pushes_on_the_tool() -> None:
    sim = Simulation(box_scene())
    put(sim, 0.5, 0.0, 0.0080)  # tips 0.7 mm deep
    sim.step(500)
    total = np.zeros(3)
    wrench = np.zeros(6)
    for i, contact in enumerate(sim.data.contact):
        mujoco.mj_contactForce(sim.model, sim.data, i, wrench)
        sign = 1 if sim.model.geom(contact.geom2).name.startswith("panda/") else -1
        total += sign * contact.frame.reshape(3, 3).T @ wrench[:3]
    assert total[2] > 1
    np.testing.assert_allclose(sim.external_force, total, atol=0.05)


def test_same_commands_give_the_same_bytes_and_queries_change_nothing() -> None:
    scene = box_scene(SIZES[1], SIZES[0])
    hashes = []
    for query in (False, True):
        sim = Simulation(scene)
        q = put(sim, 0.5, 0.0, 0.0105)
        sim.close_gripper()
        for k in range(60):
            sim.set_arm_target(q + 0.0005 * k, np.full(7, 0.05))
            sim.step(5)
            if query:
                contact_force(sim)
                sim.held()
                sim.external_force  # noqa: B018
                sim.object_pose("box_0")
        hashes.append(sim.state_hash())
    assert hashes[0] == hashes[1]
    assert len(hashes[0]) == 64


def test_reset_returns_to_the_scene() -> None:
    scene = box_scene(SIZES[0])
    sim = Simulation(scene)
    fresh = sim.state_hash()
    put(sim, 0.5, 0.0, 0.02)
    sim.close_gripper()
    sim.step(300)
    assert sim.state_hash() != fresh
    sim.reset()
    assert sim.state_hash() == fresh
    assert sim.time == 0
    np.testing.assert_array_equal(sim.q, panda.Q_HOME)
    assert sim.gripper_width == pytest.approx(hand.GRIPPER_MAX_WIDTH)


def test_poses_belong_to_the_present_joint_positions() -> None:
    sim = Simulation(box_scene())
    q = panda.Q_HOME + 0.002
    sim.set_arm_target(q, np.full(7, 0.2))
    sim.step(3)
    KINEMATICS.data.qpos[:] = sim.q
    mujoco.mj_kinematics(KINEMATICS.model, KINEMATICS.data)
    np.testing.assert_allclose(sim.T_world_tcp[:3, 3], KINEMATICS.data.site("tcp").xpos, atol=1e-12)


def test_scene_without_robot_is_refused() -> None:
    with pytest.raises(ConfigError, match="robot"):
        Simulation(box_scene(SIZES[0], robot=False))


def test_unknown_object_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="box_0"):
        Simulation(box_scene(SIZES[0])).object_pose("banana")


def test_a_tip_that_stands_on_an_object_does_not_hold_it() -> None:
    size = (0.06, 0.07, 0.03)
    sim = Simulation(box_scene(size, mass=0.2))
    above = np.array([CENTRE[0], CENTRE[1], size[2] + hand.FINGERTIP_BEYOND_TCP + 0.02])
    q = put(sim, *above)
    sim.open_gripper(0.03)
    sim.step(400)
    travel(sim, q, above, above - [0.0, 0.0, 0.0215], 0.05)
    assert contact_force(sim) > 1.0
    assert sim.finger_forces() == {}
