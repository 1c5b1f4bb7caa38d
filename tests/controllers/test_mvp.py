"""Laws of MVP."""

from __future__ import annotations

import numpy as np
from toy_ticks import observe
from toy_views import Blob

from mpgrasp.controllers import make_controller
from mpgrasp.geometry import FloatArray


def test_mvp_trusts_many_views_over_the_best_one() -> None:
    flicker, steady = Blob(x=0.55, y=0.05, quality=lambda height: 1.0), Blob(x=0.48, y=-0.03)
    grasps: dict[str, FloatArray] = {}
    for name in ("mvp_robust", "mppc"):
        controller = make_controller(name)
        for tick in range(12):
            controller.update(observe((0.43, 0.0, 0.4), flicker if tick == 3 else steady))
        grasp = controller.final_grasp()
        assert grasp is not None
        grasps[name] = grasp.position[:2]
    assert np.hypot(*(grasps["mvp_robust"] - [steady.x, steady.y])) < 0.006
    assert np.hypot(*(grasps["mppc"] - [flicker.x, flicker.y])) < 0.006
