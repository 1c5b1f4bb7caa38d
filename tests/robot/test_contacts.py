"""What the fingers clamp from both sides is held; what one pushes, what hangs and what lies wedged is not."""

from __future__ import annotations

import numpy as np
import pytest
from box_scenes import CENTRE, box_scene, grasp, put, travel

from mpgrasp.geometry import FloatArray
from mpgrasp.robot import hand
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import build_scene
from mpgrasp.scene.simulation import Simulation

GRAVITY = 9.81


def place(sim: Simulation, name: str, position: FloatArray) -> None:
    """Put an object there, at rest and straight."""
    free = sim.data.joint(sim.model.body(name).jntadr[0])
    free.qpos[:] = [*position, 1.0, 0.0, 0.0, 0.0]
    free.qvel[:] = 0.0


@pytest.mark.parametrize("force", [30.0, 70.0])
@pytest.mark.parametrize("width", [0.03, 0.001])
def test_a_box_between_the_pads_is_pressed_with_the_grip_force_from_either_side(
    force: float, width: float
) -> None:
    size = (0.06, width, 0.04)
    sim = Simulation(box_scene(size))
    grasp(sim, size, force)
    np.testing.assert_allclose(sim.finger_forces()["box_0"], [force, force], atol=1.0)
    assert sim.held() == {"box_0"}


@pytest.mark.parametrize(("slope", "pressing"), [(-12.0, 0), (12.0, 1)])
def test_what_leans_against_one_finger_is_not_held(slope: float, pressing: int) -> None:
    sim = Simulation(box_scene((0.06, 0.03, 0.04), mass=0.5))
    put(sim, *CENTRE, 0.02)
    # the table slopes along y; the hand's y axis, from the right finger to the left, is the world's -y
    sim.model.opt.gravity[1] = slope
    sim.step(1000)
    forces = sim.finger_forces()["box_0"]
    assert forces[pressing] > 1.0
    assert forces[1 - pressing] == 0.0
    assert sim.held() == set()


@pytest.mark.parametrize("shift", [0.07, -0.07])
def test_a_finger_that_pushes_with_its_back_presses_outwards(shift: float) -> None:
    sim = Simulation(box_scene((0.06, 0.03, 0.04), mass=0.5))
    beside = np.array([CENTRE[0], CENTRE[1] - shift, 0.02])
    above = beside + np.array([0.0, 0.0, 0.2])
    sim.close_gripper()
    q = put(sim, *above)
    sim.step(800)
    q, _ = travel(sim, q, above, beside, 0.2)
    travel(sim, q, beside, beside + np.array([0.0, 0.6 * shift, 0.0]), 0.05)
    forces = sim.finger_forces()["box_0"]
    assert forces.min() < -1.0
    assert forces.max() == 0.0
    assert sim.held() == set()


@pytest.mark.parametrize("apart", [0.0, 0.002])
@pytest.mark.parametrize("mass", [0.05, 0.3, 1.0])
def test_what_lies_wedged_on_the_diagonals_is_pressed_by_its_weight_and_not_held(
    mass: float, apart: float
) -> None:
    # a stirrup: its upper bar lies in the groove over the pads, its heavy lower one hangs below the tips
    stirrup = ObjectModel(
        name="stirrup",
        parts=(
            Part(shape="box", size=(0.035, 0.009, 0.002)),
            *(Part(shape="box", size=(0.004, 0.002, 0.018), position=(x, 0, -0.02)) for x in (-0.03, 0.03)),
            Part(shape="box", size=(0.035, 0.012, 0.008), position=(0, 0, -0.046)),
        ),
        mass=mass,
        friction=0.01,
    )
    sim = Simulation(build_scene(SceneConfig(objects=(stirrup,), cloth_unevenness=0.0), 0))
    put(sim, *CENTRE, 0.3)
    sim.open_gripper(apart)
    if not apart:
        sim.close_gripper()
    sim.step(800)
    place(sim, "stirrup", sim.T_world_tcp[:3, 3] + [0.0, 0.0, 0.024 - hand.FINGERTIP_BEYOND_TCP])
    sim.step(1500)
    # two planes, 30 degrees from upright and all but smooth: each pushes with W / (2 sin 30)
    np.testing.assert_allclose(sim.finger_forces()["stirrup"], np.cos(np.pi / 6) * mass * GRAVITY, rtol=0.05)
    assert sim.object_pose("stirrup")[2, 3] > 0.25
    assert sim.held() == set()
