"""Laws of going straight down: never aside, at one speed, turned and done as the robust controller is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_ticks import OBJECT, observe
from toy_views import Blob

from mpgrasp.controllers import make_controller, settings_read
from mpgrasp.controllers.config import MPPC_ROBUST
from mpgrasp.controllers.controller import Controller


@pytest.mark.parametrize("blob", [OBJECT, Blob(x=0.35, y=0.12), Blob(x=0.45, y=0.0, quality=lambda _: 0.0)])
@pytest.mark.parametrize("height", [0.5, 0.3, 0.2])
def test_it_never_moves_sideways_whatever_it_sees(blob: Blob, height: float) -> None:
    controller: Controller = make_controller("straight_down")
    for _ in range(3):
        command = controller.update(observe((0.43, 0.0, height), blob))
        assert not command.done
        assert np.array_equal(command.twist[:2], [0.0, 0.0])
        assert np.array_equal(command.twist[3:5], [0.0, 0.0])
        assert command.twist[2] == -MPPC_ROBUST.v_z


def test_it_turns_and_grasps_as_the_robust_controller_does_on_the_same_views() -> None:
    down: Controller = make_controller("straight_down")
    robust: Controller = make_controller("mppc_robust")
    for height in (0.5, 0.4, 0.3, 0.17):
        commands = [controller.update(observe((0.43, 0.0, height), OBJECT)) for controller in (down, robust)]
        assert commands[0].twist[5] == commands[1].twist[5]
        assert commands[0].done == commands[1].done
    a, b = down.final_grasp(), robust.final_grasp()
    assert a is not None
    assert b is not None
    assert np.array_equal(a.position, b.position)
    assert (a.angle, a.width, a.quality) == (b.angle, b.width, b.quality)


@pytest.mark.parametrize("key", ["alpha", "gamma", "v_1", "window", "border", "descent", "cost_heights"])
def test_settings_of_sideways_motion_are_none_of_its_own(key: str) -> None:
    assert key not in settings_read("straight_down")


def test_its_speed_can_be_set() -> None:
    controller: Controller = make_controller("straight_down", replace(MPPC_ROBUST, v_z=0.03))
    assert controller.update(observe((0.43, 0.0, 0.5), OBJECT)).twist[2] == -0.03
