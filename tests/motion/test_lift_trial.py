"""Grasps from the true pose, tried by the free hand: each ends as it must, and as the arm's would."""

from __future__ import annotations

import re
from typing import Any, get_args

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down, wrap_half_pi
from mpgrasp.grasp import Grasp
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution import execute_grasp
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.ik import solve_pose
from mpgrasp.motion.lift_trial import LiftOutcome, LiftResult, LiftRig
from mpgrasp.outcome import Outcome
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.simulation import Simulation

BOX = (0.10, 0.04, 0.05)
"""Length, width and height [m]: the hand opens to 80 mm."""


def block(length: float, width: float, height: float, **changes: Any) -> ObjectModel:
    values: dict[str, Any] = {
        "name": "block", "friction": 0.5, "mass": max(0.004, 500 * height * width * length),
        "parts": (Part(shape="box", size=(length / 2, width / 2, height / 2)),),
    }  # fmt: skip
    return ObjectModel(**(values | changes))


def scene_with(*models: ObjectModel, seed: int = 0, robot: bool = False) -> Scene:
    return build_scene(SceneConfig(objects=models, half_extent=0.12), seed, robot=robot)


def grasp_of(
    scene: Scene, height: float, width: float, offset: tuple[float, float] = (0.0, 0.0), turn: float = 0.0
) -> Grasp:
    """Across the block, which lies along its x axis; the offset [m] is in its own axes."""
    body = scene.data().body("block")
    R = body.xmat.reshape(3, 3)
    position = body.xpos + R[:, 0] * offset[0] + R[:, 1] * offset[1] + [0.0, 0.0, height / 2]
    angle = float(wrap_half_pi(np.arctan2(R[1, 1], R[0, 1]) + turn))
    return Grasp(position=position, angle=angle, width=width, quality=1.0)


def attempt(scene: Scene, grasp: Grasp, **config: float) -> LiftResult:
    return LiftRig(scene, ExecutionConfig(**config)).attempt(grasp)


@pytest.fixture(scope="module")
def box() -> Scene:
    return scene_with(block(*BOX))


def test_a_box_comes_up_by_its_middle(box: Scene) -> None:
    result = attempt(box, grasp_of(box, BOX[2], BOX[1]))
    assert (result.outcome, result.lifted) == (Outcome.SUCCESS, "block"), result.reason
    assert result.rise == pytest.approx(ExecutionConfig().lift, abs=0.005)
    assert 3.0 < result.duration < 8.0


def test_the_same_grasp_across_its_long_side_does_not_lift(box: Scene) -> None:
    result = attempt(box, grasp_of(box, BOX[2], 0.07, turn=np.pi / 2))
    assert result.outcome is Outcome.COLLISION
    assert (result.lifted, result.rise) == (None, 0.0)


def test_closing_beside_the_object_is_a_miss(box: Scene) -> None:
    result = attempt(box, grasp_of(box, BOX[2], 0.02, offset=(0.0, 0.08)))
    assert (result.outcome, result.lifted) == (Outcome.MISSED, None)
    assert result.duration < 3.0  # nothing is carried up and shaken


def test_a_finger_that_lands_on_the_object_is_a_collision(box: Scene) -> None:
    grasp = grasp_of(box, BOX[2], BOX[1], offset=(0.0, 0.02))
    result = attempt(box, grasp)
    assert result.outcome is Outcome.COLLISION
    met = re.search(r"met something ([\d.]+) mm", result.reason)
    assert met is not None
    assert float(met[1]) == pytest.approx(1e3 * grasp.position[2], abs=1.5)  # the box's top


def test_a_grasp_seen_far_below_what_stands_there_is_a_collision() -> None:
    tower = scene_with(block(0.05, 0.05, 0.15))
    grasp = grasp_of(tower, -0.10, 0.05)  # the pre-grasp lies inside of the tower
    assert attempt(tower, grasp).outcome is Outcome.COLLISION


@pytest.mark.parametrize("seed", range(2))
def test_a_stick_of_four_and_a_half_millimetres_on_an_uneven_cloth_is_lifted(seed: int) -> None:
    scene = scene_with(block(0.06, 0.0045, 0.0045), seed=seed)
    result = attempt(scene, grasp_of(scene, 0.0045, 0.0045))
    assert result.outcome is Outcome.SUCCESS, result.reason


def test_what_the_fingers_clamp_above_their_pads_is_lifted() -> None:
    # an H on its side, whose head of 30 mm the parts above the pads reach first
    head = Part(shape="box", size=(0.03, 0.015, 0.004), position=(0.0, 0.0, 0.022))
    web = Part(shape="box", size=(0.03, 0.001, 0.018))
    foot = Part(shape="box", size=(0.03, 0.02, 0.004), position=(0.0, 0.0, -0.022))
    scene = scene_with(block(0.06, 0.03, 0.052, mass=0.05, parts=(head, web, foot)))
    result = attempt(scene, grasp_of(scene, 0.052, 0.03))
    assert (result.outcome, result.lifted) == (Outcome.SUCCESS, "block"), result.reason
    assert result.rise == pytest.approx(ExecutionConfig().lift, abs=0.005)


def test_what_weighs_more_than_friction_holds_slips() -> None:
    # two pads of 40 N at a friction of 0.3 hold 24 N
    light, heavy = (scene_with(block(*BOX, mass=mass, friction=0.3)) for mass in (1.0, 4.0))
    assert attempt(light, grasp_of(light, BOX[2], BOX[1])).outcome is Outcome.SUCCESS
    assert attempt(heavy, grasp_of(heavy, BOX[2], BOX[1])).outcome is Outcome.SLIPPED


def test_the_configured_force_decides_what_slips() -> None:
    # 1.8 kg at a friction of 0.3 need 29.4 N of each pad, and more when shaken
    scene = scene_with(block(*BOX, mass=1.8, friction=0.3))
    grasp = grasp_of(scene, BOX[2], BOX[1])
    assert attempt(scene, grasp, grip_force=30.0).outcome is Outcome.SLIPPED
    assert attempt(scene, grasp, grip_force=60.0).outcome is Outcome.SUCCESS


def test_the_result_does_not_depend_on_what_was_tried_before() -> None:
    scene = scene_with(block(*BOX), block(0.06, 0.02, 0.03, name="other"))
    grasps = [
        grasp_of(scene, BOX[2], BOX[1]),
        grasp_of(scene, BOX[2], BOX[1], offset=(0.03, 0.02)),
        grasp_of(scene, BOX[2], BOX[1], offset=(-0.04, 0.0), turn=0.2),
    ]
    rig = LiftRig(scene)
    forth = [rig.attempt(grasp) for grasp in grasps]
    back = [rig.attempt(grasp) for grasp in reversed(grasps)][::-1]
    alone = [LiftRig(scene).attempt(grasp) for grasp in grasps]
    assert forth == back == alone
    assert {result.outcome for result in forth} >= {"success", "collision"}


def test_the_scene_itself_is_left_as_it_was(box: Scene) -> None:
    model, state = box.model.nq, box.state.copy()
    attempt(box, grasp_of(box, BOX[2], BOX[1]))
    assert (box.model.nq, box.data().ncon) == (model, box.data().ncon)
    assert np.array_equal(box.state, state)
    assert all("panda" not in body.name for body in box.spec.bodies)


@pytest.mark.parametrize(
    ("offset", "turn", "width"),
    [((0.0, 0.0), 0.0, 0.04), ((0.045, 0.0), 0.3, 0.045), ((0.0, 0.07), 0.0, 0.02), ((0.0, 0.0), 1.2, 0.06)],
)
def test_the_arm_ends_the_same_grasp_alike(
    box: Scene, offset: tuple[float, float], turn: float, width: float
) -> None:
    grasp = grasp_of(box, BOX[2], width, offset=offset, turn=turn)
    simulation = Simulation(scene_with(block(*BOX), robot=True))
    simulation.set_q(solve_pose(simulation.q, looking_down([0.45, 0.0, 0.25])))
    expected = execute_grasp(ArmDriver(simulation), grasp)
    result = attempt(box, grasp)
    assert (result.outcome, result.lifted) == (expected.outcome, expected.lifted), expected.reason
    assert result.outcome in get_args(LiftOutcome)


@pytest.mark.parametrize("field", ["position", "angle", "width"])
def test_a_grasp_that_is_not_finite_is_refused(box: Scene, field: str) -> None:
    values: dict[str, Any] = {"position": np.array([0.5, 0, 0.02]), "angle": 0.0, "width": 0.02, "quality": 1}
    values[field] = values[field] * np.nan
    with pytest.raises(ConfigError, match="not finite"):
        LiftRig(box).attempt(Grasp(**values))


def test_a_scene_with_an_arm_is_refused() -> None:
    with pytest.raises(ConfigError, match="robot=False"):
        LiftRig(scene_with(block(*BOX), robot=True))
