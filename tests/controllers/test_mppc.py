"""Laws of MP-PC: it slows down without a peak, and takes the best grasp of all views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_ticks import NOTHING, observe, same
from toy_views import Blob, fly

from mpgrasp.controllers import make_controller
from mpgrasp.controllers.config import MPPC
from mpgrasp.controllers.mppc import Mppc
from mpgrasp.grasp import peak_height


def test_with_nothing_in_view_mvp_drifts_away_and_mppc_hardly_does() -> None:
    """The failure that the paper is about, and its cure."""
    paths = {}
    for name in ("mppc", "mvp"):
        flights = [fly(make_controller(name), NOTHING, seed=seed, noise=0.01) for seed in range(3)]
        # of the tool: the camera, 7 cm in front of it, moves on when the hand turns
        paths[name] = np.mean([sum(np.hypot(*c.twist[:2]) * 0.1 for c in f.commands) for f in flights])
        drift = np.mean([np.hypot(*(f.camera[-1] - f.camera[0])) for f in flights])
        assert (drift > 0.3) if name == "mvp" else (drift < 0.2)
    # what alpha = 0.2 of 0.1 m/s lets through in 6.5 s
    assert paths["mppc"] <= 0.2 * 0.1 * 6.5 + 1e-6
    assert paths["mvp"] > 3.5 * paths["mppc"]


def test_without_a_peak_mppc_goes_sideways_at_exactly_alpha_and_mvp_does_not_care() -> None:
    dull = 0.3
    for alpha in (0.0, 0.2, 0.7):
        config = replace(MPPC, alpha=alpha)
        view = observe((0.4, 0.1, 0.45), dull)
        mppc, mvp = make_controller("mppc", config).update(view), make_controller("mvp").update(view)
        assert np.hypot(*mvp.twist[:2]) > 0.05
        np.testing.assert_allclose(mppc.twist[:2], alpha * mvp.twist[:2], rtol=1e-12)
        assert mppc.twist[2] == mvp.twist[2] == -config.v_z


def test_with_a_peak_mppc_moves_as_mvp_does() -> None:
    mppc, mvp = (make_controller(n).update(observe((0.4, 0.1, 0.45))) for n in ("mppc", "mvp"))
    np.testing.assert_array_equal(mppc.twist[:3], mvp.twist[:3])


def test_a_peak_is_three_pixels_wide_and_not_one() -> None:
    quality = np.zeros((30, 40), np.float32)
    quality[12, 7] = 1.0
    assert peak_height(quality) == pytest.approx(1 / 9)
    quality[20:23, 30:33] = 0.6
    assert peak_height(quality) == pytest.approx(0.6)
    for height, exists in ((0.59, True), (0.61, False)):
        controller = make_controller("mppc", replace(MPPC, peak_threshold=height))
        observation = observe((0.43, 0.0, 0.45), 0.0)
        observation.grasp_map.quality[50:53, 80:83] = 0.6
        controller.update(observation)
        assert controller.diagnostics()["peak"] is exists


def test_mppc_takes_the_best_grasp_of_all_views_and_empties_its_pool_on_reset() -> None:
    controller = Mppc()
    qualities = [0.3, 0.85, 0.6]
    for quality in qualities:
        controller.update(observe((0.43, 0.0, 0.4), Blob(x=0.5, y=0.0, quality=lambda height, q=quality: q)))  # type: ignore[misc]
    assert len(controller.pool) == 3
    grasp = controller.final_grasp()
    assert grasp is not None
    assert grasp.quality == pytest.approx(0.85, abs=0.01)
    controller.reset(0)
    assert controller.pool == []


def test_of_equally_good_grasps_mppc_takes_the_one_seen_last() -> None:
    controller = Mppc()
    for x in (0.48, 0.52):
        observation = observe((0.43, 0.0, 0.4), Blob(x=x, y=0.0))
        quality = observation.grasp_map.quality
        quality[:] = quality > 0.7
        controller.update(observation)
    grasp = controller.final_grasp()
    assert grasp is not None
    assert grasp.quality == 1.0
    assert abs(controller.pool[0].position[0] - controller.pool[1].position[0]) > 0.02
    assert grasp is controller.pool[1]


def test_the_robust_one_grasps_as_robust_mvp_does_and_goes_sideways_at_alpha() -> None:
    flicker, steady = Blob(x=0.55, y=0.05, quality=lambda height: 1.0), Blob(x=0.48, y=-0.03)
    hybrid, mvp = make_controller("mppc_robust"), make_controller("mvp_robust")
    views: list[Blob | float] = [0.3, *(flicker if tick == 3 else steady for tick in range(12))]
    for view in views:
        ours, full = (c.update(observe((0.43, 0.0, 0.4), view)) for c in (hybrid, mvp))
        assert same(ours, full) == (view != 0.3)
        share = 0.2 if view == 0.3 else 1.0
        np.testing.assert_allclose(ours.twist[:2], share * full.twist[:2])
    one, other = hybrid.final_grasp(), mvp.final_grasp()
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.position, other.position)
    assert (one.angle, one.width, one.quality) == (other.angle, other.width, other.quality)
