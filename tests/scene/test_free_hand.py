"""The hand without its arm: the same geometry, the same give, and a scene that it leaves alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down
from mpgrasp.motion.ik import solve_pose
from mpgrasp.robot import hand as franka_hand
from mpgrasp.robot import panda
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.free_hand import DAMPING, INERTIA, STIFFNESS, FreeHand
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.simulation import Simulation
from mpgrasp.workspace import WORKSPACE_CENTRE

CONFIG = SceneConfig(objects=("usb_stick", "soap"))
HAND_GEOMS = (
    "hand", "camera_housing", "camera_mount", "left_mount", "left_sledge", "left_diagonal", "left_pad",
    "right_mount", "right_sledge", "right_diagonal", "right_pad",
)  # fmt: skip


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(CONFIG, 3, robot=False)


@pytest.fixture(scope="module")
def arm() -> Simulation:
    simulation = Simulation(build_scene(CONFIG, 3))
    simulation.set_q(solve_pose(simulation.q, looking_down([*WORKSPACE_CENTRE, 0.02])))
    return simulation


@pytest.fixture
def hand(scene: Scene) -> FreeHand:
    return FreeHand(scene)


def geoms_in_tool_frame(model: mujoco.MjModel, data: mujoco.MjData) -> dict[str, np.ndarray]:
    mujoco.mj_forward(model, data)
    tcp = data.site(panda.PREFIX + "tcp")
    R = tcp.xmat.reshape(3, 3)
    found = {}
    for k in range(model.ngeom):
        geom = data.geom(k)
        if model.geom_group[k] == panda.ROBOT_GROUP and "link" not in geom.name:
            turned = R.T @ geom.xmat.reshape(3, 3)
            found[geom.name] = np.column_stack([R.T @ (geom.xpos - tcp.xpos), turned, model.geom_size[k]])
    return found


def test_every_part_of_the_hand_is_where_the_arm_carries_it(hand: FreeHand, arm: Simulation) -> None:
    hand.place([0.4, 0.1, 0.2], 0.7, franka_hand.GRIPPER_MAX_WIDTH)
    mine, its = geoms_in_tool_frame(hand.model, hand.data), geoms_in_tool_frame(arm.model, arm.data)
    assert set(mine) == set(its) == {panda.PREFIX + name for name in HAND_GEOMS}
    for name, expected in its.items():
        assert mine[name] == pytest.approx(expected, abs=1e-6), name


def test_the_hand_yields_and_weighs_as_the_arm_does_over_the_middle_of_the_workspace(arm: Simulation) -> None:
    model, data = arm.model, arm.data
    joints = [model.joint(panda.PREFIX + name) for name in panda.ARM_JOINTS]
    dofs = [int(j.dofadr[0]) for j in joints]
    drives = [model.actuator(panda.PREFIX + name).id for name in panda.ARM_JOINTS]
    J, M = np.zeros((6, model.nv)), np.zeros((model.nv, model.nv))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], model.site(panda.PREFIX + "tcp").id)
    for row, column in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, M[row], column)
    J = J[[0, 1, 2, 5]][:, dofs]
    for mine, its in (
        (STIFFNESS, np.diag(model.actuator_gainprm[drives, 0])),
        (DAMPING, np.diag(-model.actuator_biasprm[drives, 2])),
        (INERTIA, M[np.ix_(dofs, dofs)]),
    ):
        assert np.array(mine) == pytest.approx(1 / np.diag(J @ np.linalg.inv(its) @ J.T), rel=0.05)


def test_placed_the_tool_point_looks_down_at_that_heading(hand: FreeHand) -> None:
    hand.place([0.45, -0.1, 0.25], -1.2, 0.03)
    mujoco.mj_forward(hand.model, hand.data)
    site = hand.data.site(panda.PREFIX + "tcp")
    expected = looking_down([0.45, -0.1, 0.25], -1.2)
    assert site.xpos == pytest.approx(expected[:3, 3])
    assert site.xmat.reshape(3, 3) == pytest.approx(expected[:3, :3], abs=1e-9)
    assert hand.T_world_tcp == pytest.approx(expected)
    assert hand.gripper_width == pytest.approx(0.03)


def test_at_constant_speed_the_hand_does_not_lag(hand: FreeHand) -> None:
    hand.place([0.5, 0.0, 0.3], 0.4, 0.05)
    target = np.array([0.5, 0.0, 0.3])
    for _ in range(60):
        target += [0.0005, 0.0003, -0.001]
        hand.step(target, 5)
    # a servo that damped against standstill would hang 5 mm behind; one time step is 0.2 mm of the way
    assert hand.lag < 3e-4
    assert hand.external_force == pytest.approx(np.zeros(3), abs=1e-6)


@pytest.mark.parametrize("axis", range(3))
def test_a_steady_force_bends_the_servo_by_its_stiffness(hand: FreeHand, axis: int) -> None:
    hand.place([0.5, 0.0, 0.3], 0.0, 0.05)
    # through the tool point, so that it does not turn the hand
    tcp, body = np.array([0.5, 0.0, 0.3]), hand.model.body(panda.PREFIX + "hand").id
    for _ in range(60):
        force, arm = np.zeros(3), np.zeros(3)
        force[axis] = 20.0
        arm[:] = tcp - hand.data.xipos[body]
        hand.data.xfrc_applied[body] = [*force, *np.cross(arm, force)]
        hand.step(tcp, 5)
    assert hand.T_world_tcp[axis, 3] - tcp[axis] == pytest.approx(20.0 / STIFFNESS[axis], rel=0.02)


def test_pressing_on_the_table_is_felt_as_an_upward_force(hand: FreeHand) -> None:
    spot = np.array([0.75, 0.4, franka_hand.FINGERTIP_BEYOND_TCP])  # beside the objects
    up = np.array([0.0, 0.0, 1.0])
    hand.place(spot + 0.01 * up, 0.0, 0.0)
    for k in range(100):
        hand.step(spot + max(0.01 - 0.0002 * k, -0.002) * up, 5)
    assert hand.external_force[2] == pytest.approx(STIFFNESS[2] * hand.lag, rel=0.05)
    assert hand.external_force[2] > 10.0
    assert np.abs(hand.external_force[:2]).max() < 1.0


def test_only_overlap_with_something_is_a_touch(hand: FreeHand) -> None:
    x, y, z = hand.object_pose("usb_stick")[:3, 3]
    hand.place([x, y, z + 0.05], 0.0, 0.0)
    assert not hand.touches()
    # closed fingers touch each other, and that does not count
    hand.place([x, y, z + franka_hand.FINGERTIP_BEYOND_TCP], 0.0, 0.0)
    assert hand.touches()


def test_what_is_not_touched_stays_exactly_where_it_settled(hand: FreeHand, scene: Scene) -> None:
    before = {name: scene.data().body(name).xpos.copy() for name in scene.objects}
    hand.place([0.5, 0.0, 0.4], 0.0, 0.08)
    for _ in range(50):
        hand.step(np.array([0.5, 0.0, 0.4]), 5)
    for name in scene.objects:
        assert np.array_equal(hand.object_pose(name)[:3, 3], before[name])
    assert hand.are_still(scene.objects)


def test_the_highest_point_lies_just_above_all_that_the_height_map_sees(hand: FreeHand, scene: Scene) -> None:
    seen = scene.height_map().height.max()
    assert seen - 1e-6 <= hand.top < seen + 0.01


def test_a_scene_with_an_arm_has_no_room_for_a_second_hand() -> None:
    with pytest.raises(ConfigError, match="robot=False"):
        FreeHand(build_scene(CONFIG, 3))


def test_an_object_that_is_not_there_has_no_pose(hand: FreeHand) -> None:
    with pytest.raises(ConfigError, match="usb_stick"):
        hand.object_pose("teapot")
