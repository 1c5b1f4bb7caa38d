"""Laws of open loop."""

from __future__ import annotations

import numpy as np
from toy_ticks import OBJECT, observe
from toy_views import Blob

from mpgrasp.controllers import make_controller
from mpgrasp.controllers.controller import Controller


def test_open_loop_takes_the_best_pixel_of_its_first_view_and_looks_no_further() -> None:
    controller: Controller = make_controller("open_loop")
    assert controller.update(observe((0.43, 0.0, 0.5), OBJECT)).done
    controller.update(observe((0.43, 0.0, 0.5), Blob(x=0.45, y=-0.05, quality=lambda height: 1.0)))
    grasp = controller.final_grasp()
    assert grasp is not None
    assert np.hypot(*(grasp.position[:2] - [OBJECT.x, OBJECT.y])) < 0.002
