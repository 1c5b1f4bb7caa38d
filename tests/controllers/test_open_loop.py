"""Laws of open loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from toy_ticks import OBJECT, observe
from toy_views import Blob

from mpgrasp.controllers import make_controller
from mpgrasp.controllers.config import OPEN_LOOP
from mpgrasp.controllers.controller import Controller


def test_open_loop_takes_the_best_pixel_of_its_first_view_and_looks_no_further() -> None:
    controller: Controller = make_controller("open_loop")
    assert controller.update(observe((0.43, 0.0, 0.5), OBJECT)).done
    controller.update(observe((0.43, 0.0, 0.5), Blob(x=0.45, y=-0.05, quality=lambda height: 1.0)))
    grasp = controller.final_grasp()
    assert grasp is not None
    assert np.hypot(*(grasp.position[:2] - [OBJECT.x, OBJECT.y])) < 0.002


def test_what_is_just_as_good_as_asked_for_is_grasped_and_what_is_worse_is_not() -> None:
    first: Controller = make_controller("open_loop")
    first.update(observe((0.43, 0.0, 0.5), OBJECT))
    grasp = first.final_grasp()
    assert grasp is not None
    for asked, found in ((grasp.quality, True), (np.nextafter(grasp.quality, 1), False)):
        controller: Controller = make_controller("open_loop", replace(OPEN_LOOP, min_quality=float(asked)))
        controller.update(observe((0.43, 0.0, 0.5), OBJECT))
        assert (controller.final_grasp() is not None) is found


def test_a_view_beside_the_grid_has_a_best_quality_of_zero() -> None:
    controller: Controller = make_controller("open_loop")
    controller.update(observe((3.0, 3.0, 0.5), OBJECT))
    assert (controller.final_grasp(), controller.diagnostics()["best_quality"]) == (None, 0.0)
