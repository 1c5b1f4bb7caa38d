"""The robot against what its maker publishes, computed here by other means."""

from __future__ import annotations

import itertools
import sys

import mujoco
import numpy as np
import pytest

from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.geometry import FloatArray, invert, rotation_x, rotation_z, transform, transform_points
from mpgrasp.robot import hand, panda

# a [m], d [m], alpha [rad] of joints 1..7 and the flange, modified (Craig) convention, from the FER's manual
DH = (
    (0, 0.333, 0), (0, 0, -np.pi / 2), (0, 0.316, np.pi / 2), (0.0825, 0, np.pi / 2),
    (-0.0825, 0.384, -np.pi / 2), (0, 0, np.pi / 2), (0.088, 0, np.pi / 2), (0, 0.107, 0),
)  # fmt: skip
HAND_TO_TCP = transform(rotation_z(-np.pi / 4), (0, 0, 0.1034))


def forward(q: FloatArray) -> FloatArray:
    T = np.eye(4)
    for (a, d, alpha), theta in zip(DH, [*q, 0.0], strict=True):
        T = T @ transform(rotation_x(alpha), (a, 0, 0)) @ transform(rotation_z(theta), (0, 0, d))
    return T @ HAND_TO_TCP


def pose(data: mujoco.MjData, kind: str, name: str) -> FloatArray:
    frame = getattr(data, kind)(name)
    return transform(frame.xmat.reshape(3, 3), frame.xpos)


@pytest.fixture(scope="module")
def arm() -> mujoco.MjModel:
    return panda.arm_model()


@pytest.fixture(scope="module")
def robot() -> mujoco.MjModel:
    return panda.panda_spec().compile()


def at(model: mujoco.MjModel, q: FloatArray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:7] = q
    mujoco.mj_forward(model, data)
    return data


def test_forward_kinematics_equal_the_published_denavit_hartenberg_parameters(arm: mujoco.MjModel) -> None:
    rng = np.random.default_rng(0)
    for q in (panda.Q_HOME, *rng.uniform(panda.Q_MIN, panda.Q_MAX, (20, 7))):
        np.testing.assert_allclose(pose(at(arm, q), "site", "tcp"), forward(q), atol=1e-12)


def test_limits_equal_the_published_ones(robot: mujoco.MjModel) -> None:
    q_min = [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    q_max = [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]
    torque = [87, 87, 87, 87, 12, 12, 12]
    for j in range(7):
        joint, actuator = robot.joint(f"joint{j + 1}"), robot.actuator(f"joint{j + 1}")
        assert joint.range.tolist() == actuator.ctrlrange.tolist() == [q_min[j], q_max[j]]
        assert (
            robot.jnt_actfrcrange[joint.id].tolist()
            == actuator.forcerange.tolist()
            == [-torque[j], torque[j]]
        )
    assert panda.Q_MIN.tolist() == q_min
    assert panda.Q_MAX.tolist() == q_max
    assert panda.DQ_MAX.tolist() == [2.175] * 4 + [2.61] * 3
    assert panda.DDQ_MAX.tolist() == [15, 7.5, 10, 12.5, 15, 20, 20]


def test_constants_cannot_be_changed_by_accident() -> None:
    with pytest.raises(ValueError, match="read-only"):
        panda.Q_HOME[0] = 1.0


def test_tool_points_straight_down_at_home(arm: mujoco.MjModel) -> None:
    T = pose(at(arm, panda.Q_HOME), "site", "tcp")
    np.testing.assert_allclose(T[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-12)
    assert (panda.Q_MIN < panda.Q_HOME).all()
    assert (panda.Q_HOME < panda.Q_MAX).all()


def test_camera_looks_along_the_approach_axis_from_beside_the_hand(arm: mujoco.MjModel) -> None:
    data = at(arm, panda.Q_HOME)
    T_hand_camera = invert(pose(data, "body", "hand")) @ pose(data, "cam", "wrist")
    right, up, back = T_hand_camera[:3, :3].T  # MuJoCo's camera axes
    np.testing.assert_allclose(back, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(right, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(up, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(T_hand_camera[:3, 3], [0.07, 0, 0.04], atol=1e-12)
    focal = 240 / np.tan(np.radians(arm.cam("wrist").fovy[0]) / 2)
    assert focal == pytest.approx(385.0, rel=1e-9)
    assert arm.cam_resolution[arm.cam("wrist").id].tolist() == [640, 480]


def test_camera_sees_neither_itself_nor_hand_nor_fingers(robot: mujoco.MjModel) -> None:
    data = at(robot, panda.Q_HOME)
    groups = np.ones(6, np.uint8)
    camera = data.cam("wrist")
    R = camera.xmat.reshape(3, 3)
    for opening in (0.0, 0.04):
        data.qpos[7:] = opening
        mujoco.mj_forward(robot, data)
        for u, v in itertools.product(np.linspace(-320, 320, 17), np.linspace(-240, 240, 13)):
            ray = R @ np.array([u / 385, -v / 385, -1.0])
            hit = np.zeros(1, np.int32)
            mujoco.mj_ray(robot, data, camera.xpos, ray, groups, True, -1, hit)
            # the foot of the arm comes into view at the lower edge
            assert hit[0] in (-1, robot.geom("link0").id), (u, v)


def test_finger_tips_are_the_real_ones(arm: mujoco.MjModel) -> None:
    data = at(arm, panda.Q_HOME)
    T_tcp = pose(data, "site", "tcp")
    for name, side in (("left_pad", 1), ("right_pad", -1)):
        corners = np.array(list(itertools.product((-1, 1), repeat=3))) * arm.geom(name).size
        points = transform_points(invert(T_tcp) @ pose(data, "geom", name), corners)
        assert np.ptp(points[:, 0]) == pytest.approx(hand.FINGER_WIDTH)
        assert np.ptp(points[:, 1]) == pytest.approx(hand.FINGER_THICKNESS)
        assert points[:, 2].max() == pytest.approx(hand.FINGERTIP_BEYOND_TCP)
        assert hand.TCP_OFFSET + points[:, 2].max() == pytest.approx(0.1121)
        assert np.abs(points[:, 1]).min() == pytest.approx(hand.GRIPPER_MAX_WIDTH / 2)
        assert (np.sign(points[:, 1]) == side).all()


def test_mass_is_that_of_arm_hand_fingers_and_camera(robot: mujoco.MjModel) -> None:
    links = (0.629769, 4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522)
    assert robot.body_mass.sum() == pytest.approx(sum(links) + 0.73 + 2 * 0.015 + 0.102)


def test_everything_of_the_robot_is_in_its_own_geom_group(robot: mujoco.MjModel) -> None:
    assert (robot.geom_group == panda.ROBOT_GROUP).all()


def test_no_links_touch_over_the_workspace_of_q_home(arm: mujoco.MjModel) -> None:
    for yaw in np.radians([-90, 0, 90]):
        q = panda.Q_HOME + np.array([0, 0, 0, 0, 0, 0, yaw])
        assert at(arm, np.clip(q, panda.Q_MIN, panda.Q_MAX)).ncon == 0


def test_arm_model_has_seven_joints_and_open_fingers(arm: mujoco.MjModel) -> None:
    assert arm.nv == arm.nq == 7
    assert arm.nu == 0
    data = at(arm, panda.Q_HOME)
    gap = data.body("left_finger").xpos - data.body("right_finger").xpos
    assert np.linalg.norm(gap) == pytest.approx(hand.GRIPPER_MAX_WIDTH)


def test_collision_pairs_name_geoms_of_the_arm_model(arm: mujoco.MjModel, robot: mujoco.MjModel) -> None:
    for group in itertools.chain(*panda.collision_pairs(arm)):
        for name in group:
            arm.geom(name)
    with pytest.raises(ConfigError, match="table"):
        panda.collision_pairs(robot)


def test_specs_are_independent() -> None:
    spec = panda.panda_spec()
    spec.body("hand").mass = 5.0
    assert panda.panda_spec().body("hand").mass == pytest.approx(0.73)


def test_saved_world_with_robot_compiles_again() -> None:
    world = mujoco.MjSpec()
    world.attach(panda.panda_spec(), prefix=panda.PREFIX, frame=world.worldbody.add_frame())
    world.compile()
    again = mujoco.MjModel.from_xml_string(world.to_xml())
    assert again.nmesh == 9
    np.testing.assert_allclose(again.key("panda/home").qpos[:7], panda.Q_HOME, atol=1e-5)


def test_missing_meshes_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    panda.mesh_directory.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(sys, "path", [])
        with pytest.raises(AssetError, match="example-robot-data"):
            panda.mesh_directory()
    assert (panda.mesh_directory() / "hand.stl").is_file()
