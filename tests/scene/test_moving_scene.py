"""The gripper is the same on the arm and on the free hand: same widths, same forces, same refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.robot import hand
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.free_hand import FreeHand
from mpgrasp.scene.moving_scene import MovingScene
from mpgrasp.scene.scene import build_scene
from mpgrasp.scene.simulation import Simulation

CONFIG = SceneConfig(objects=("usb_stick",))
Step = Callable[[int], None]


def on_the_arm() -> tuple[MovingScene, Step]:
    simulation = Simulation(build_scene(CONFIG, 3))
    return simulation, simulation.step


def flying() -> tuple[MovingScene, Step]:
    free = FreeHand(build_scene(CONFIG, 3, robot=False))
    place = free.T_world_tcp[:3, 3].copy()
    return free, lambda n: free.step(place, n)


BODIES = pytest.mark.parametrize("carried", [on_the_arm, flying])


@BODIES
def test_the_gripper_moves_to_a_width_at_its_speed(carried: Callable[[], tuple[MovingScene, Step]]) -> None:
    scene, step = carried()
    assert scene.gripper_width == pytest.approx(hand.GRIPPER_MAX_WIDTH)
    scene.open_gripper(0.03)
    start, widths = scene.time, []
    for _ in range(100):
        step(5)
        widths.append(scene.gripper_width)
    assert widths[-1] == pytest.approx(0.03, abs=1e-5)
    assert np.abs(np.diff(widths)).max() / 0.01 < 1.05 * hand.GRIPPER_SPEED
    assert scene.time - start == pytest.approx(1.0)


@BODIES
def test_it_closes_and_opens_again_all_the_way(carried: Callable[[], tuple[MovingScene, Step]]) -> None:
    scene, step = carried()
    scene.close_gripper()
    step(1250)
    assert scene.gripper_width == pytest.approx(0.0, abs=1e-3)
    assert (scene.finger_forces(), scene.held()) == ({}, set())  # the pads press each other: no object
    scene.open_gripper()
    step(1000)
    assert scene.gripper_width == pytest.approx(hand.GRIPPER_MAX_WIDTH, abs=1e-5)


@BODIES
@pytest.mark.parametrize("force", [29.0, 71.0])
def test_a_force_that_the_hand_cannot_hold_is_refused(
    carried: Callable[[], tuple[MovingScene, Step]], force: float
) -> None:
    with pytest.raises(ConfigError, match="30"):
        carried()[0].close_gripper(force)


@BODIES
def test_objects_lie_where_they_settled_and_others_are_unknown(
    carried: Callable[[], tuple[MovingScene, Step]],
) -> None:
    scene, _ = carried()
    settled = build_scene(CONFIG, 3, robot=False).data().body("usb_stick").xpos
    np.testing.assert_array_equal(scene.object_pose("usb_stick")[:3, 3], settled)
    with pytest.raises(ConfigError, match="usb_stick"):
        scene.object_pose("teapot")
