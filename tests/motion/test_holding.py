"""What is held stays as it was grasped: no creep, however long, and no more friction than Coulomb gives."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mpgrasp.geometry import invert, looking_down, wrap_half_pi
from mpgrasp.grasp import Grasp
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution import execute_grasp
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.hand_driver import HandDriver
from mpgrasp.motion.ik import solve_pose
from mpgrasp.outcome import Outcome
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.free_hand import FreeHand
from mpgrasp.scene.moving_scene import MovingScene
from mpgrasp.scene.objects.catalogue import load_object
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.simulation import Simulation
from mpgrasp.scene.solver import NO_SLIP_ITERATIONS, NO_SLIP_TOLERANCE

LONG, SHORT = 30000, 5000
"""Time steps of 2 ms: a minute, and 10 s."""


def shape(kind: str, size: tuple[float, ...], mass: float, friction: float = 0.6) -> ObjectModel:
    part = Part(shape=kind, size=size)
    return ObjectModel(name="thing", parts=(part,), mass=mass, friction=friction, rgba=(0.5, 0.5, 0.5, 1.0))


def grasp_across(scene: MovingScene, model: ObjectModel, offset: float) -> Grasp:
    """Across the object's y axis, beside its middle along x."""
    T = scene.object_pose(model.name)
    top = (model.points @ T[:3, :3].T)[:, 2].max()
    return Grasp(
        position=T[:3, 3] + T[:3, 0] * offset + [0.0, 0.0, top],
        angle=float(wrap_half_pi(np.arctan2(T[1, 1], T[0, 1]))),
        width=float(np.ptp(model.points[:, 1])),
        quality=1.0,
    )


def held(model: ObjectModel, seed: int, offset: float, force: float = 40.0) -> tuple[Simulation, Outcome]:
    scene = build_scene(SceneConfig(objects=(model,), half_extent=0.12), seed)
    simulation = Simulation(scene)
    simulation.set_q(solve_pose(simulation.q, looking_down([0.45, 0.0, 0.25])))
    grasp = grasp_across(simulation, model, offset)
    result = execute_grasp(ArmDriver(simulation), grasp, ExecutionConfig(grip_force=force))
    return simulation, result.outcome


def in_hand(scene: MovingScene, name: str) -> np.ndarray:
    return invert(scene.T_world_tcp) @ scene.object_pose(name)


def crept(before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
    """Way [mm] and turn [deg], the angle from the trace."""
    moved = invert(before) @ after
    cosine = np.clip((np.trace(moved[:3, :3]) - 1) / 2, -1, 1)
    return 1e3 * float(np.linalg.norm(moved[:3, 3])), float(np.degrees(np.arccos(cosine)))


@pytest.mark.parametrize(("seed", "offset"), [(0, 0.0), (0, 0.008), (2, 0.0), (3, 0.008)])
def test_a_held_usb_stick_does_not_creep_in_a_minute(seed: int, offset: float) -> None:
    simulation, outcome = held(load_object("usb_stick"), seed, offset)
    assert outcome is Outcome.SUCCESS
    before = in_hand(simulation, "usb_stick")
    simulation.step(LONG)
    way, turn = crept(before, in_hand(simulation, "usb_stick"))
    assert simulation.held() == {"usb_stick"}
    assert way < 0.5
    assert turn < 2.0


@pytest.mark.parametrize(
    ("model", "offset", "force"),
    [
        (shape("box", (0.03, 0.004, 0.004), 0.004), 0.006, 70.0),
        (shape("box", (0.12, 0.01, 0.01), 0.2), 0.01, 40.0),
        (shape("box", (0.04, 0.03, 0.03), 0.8), 0.0, 70.0),
        (shape("cylinder", (0.02, 0.03), 0.1), 0.0, 40.0),
        (load_object("key"), 0.006, 40.0),
        (load_object("plate_brick"), 0.008, 40.0),
    ],
    ids=["thin stick", "long bar", "heavy block", "cylinder", "key", "plate brick"],
)
def test_nothing_that_is_held_creeps(model: ObjectModel, offset: float, force: float) -> None:
    simulation, outcome = held(model, 1, offset, force)
    assert outcome is Outcome.SUCCESS
    before = in_hand(simulation, model.name)
    simulation.step(SHORT)
    way, turn = crept(before, in_hand(simulation, model.name))
    # a minute's half millimetre and two degrees, in proportion to the time
    assert way < 0.5 * SHORT / LONG
    assert turn < 2.0 * SHORT / LONG


def test_the_free_hand_holds_as_still_as_the_arm() -> None:
    model = load_object("usb_stick")
    hand = FreeHand(build_scene(SceneConfig(objects=(model,), half_extent=0.12), 2, robot=False))
    grasp = grasp_across(hand, model, 0.0)
    position = grasp.position - [0.0, 0.0, 0.004]
    hand.place(position, grasp.angle + np.pi / 2, 0.028)
    driver = HandDriver(hand)
    hand.close_gripper()
    driver.wait(1.0)
    above = driver.T_desired.copy()
    above[2, 3] += 0.1
    driver.move_to(above, 0.1)
    assert hand.held() == {"usb_stick"}
    before = in_hand(hand, "usb_stick")
    driver.wait(SHORT * 0.002)
    way, turn = crept(before, in_hand(hand, "usb_stick"))
    assert way < 0.5 * SHORT / LONG
    assert turn < 2.0 * SHORT / LONG


@pytest.mark.parametrize(("share", "expected"), [(0.8, True), (1.25, False)])
def test_friction_holds_what_coulomb_lets_it_hold_and_no_more(share: float, expected: bool) -> None:
    friction, force = 0.2, 30.0
    mass = share * 2 * friction * force / 9.81
    thing = shape("box", (0.03, 0.02, 0.02), mass, friction)
    simulation = Simulation(build_scene(SceneConfig(objects=(thing,)), 0))
    _clamp_in_the_air(simulation, force)
    before = in_hand(simulation, "thing")
    simulation.step(500)
    way, _ = crept(before, in_hand(simulation, "thing"))
    assert (way < 0.05) is expected


def _clamp_in_the_air(simulation: Simulation, force: float) -> None:
    """Put the thing between the pads, in the air and weightless, and let them close on it."""
    T = simulation.T_world_tcp
    joint = simulation.data.joint("thing/free")
    simulation.open_gripper(0.045)
    simulation.step(500)
    gravity = simulation.model.opt.gravity.copy()
    simulation.model.opt.gravity[:] = 0.0
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, T[:3, :3].ravel())
    joint.qpos[:] = [*T[:3, 3], *quaternion]
    joint.qvel[:] = 0.0
    mujoco.mj_forward(simulation.model, simulation.data)
    simulation.close_gripper(force)
    simulation.step(500)
    simulation.model.opt.gravity[:] = gravity


def test_every_scene_with_a_hand_solves_friction_to_the_end() -> None:
    config = SceneConfig(objects=("usb_stick",))
    scenes: list[Scene] = [build_scene(config, 0), FreeHand(build_scene(config, 0, robot=False)).scene]
    for scene in scenes:
        assert scene.model.opt.noslip_iterations == NO_SLIP_ITERATIONS
        assert scene.model.opt.noslip_tolerance == NO_SLIP_TOLERANCE
