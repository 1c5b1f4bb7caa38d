"""Laws of the heuristic: what stands out is grasped across its short side, what does not is left alone."""

from __future__ import annotations

import numpy as np
import pytest
from toy_networks import INTRINSICS, frame

from mpgrasp.detectors import make_detector
from mpgrasp.detectors.config import HeuristicConfig
from mpgrasp.detectors.heuristic import HeuristicDetector
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import GraspMap

TABLE = 0.45
NOISE = 0.0004


def bar(angle: float, *, length: float = 0.10, breadth: float = 0.03, height: float = 0.02) -> FloatArray:
    """Depth of a bar on a table; its long axis is at an angle in the image [rad], counter-clockwise."""
    v, u = np.indices((480, 640), float)
    x, y = (u - INTRINSICS.cx) / INTRINSICS.fx * TABLE, -(v - INTRINSICS.cy) / INTRINSICS.fy * TABLE
    along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    inside = (np.abs(along) < length / 2) & (np.abs(across) < breadth / 2)
    depth = np.where(inside, TABLE - height, TABLE)
    return np.asarray(depth + np.random.default_rng(0).normal(0, NOISE, depth.shape))


def best(found: GraspMap) -> tuple[int, int]:
    row, col = np.unravel_index(int(np.argmax(found.quality)), found.quality.shape)
    return int(row), int(col)


@pytest.mark.parametrize("angle", np.deg2rad([0, 20, 45, 70, 90, 130, 170]))
def test_a_bar_is_grasped_at_its_middle_across_its_short_side(angle: float) -> None:
    found = HeuristicDetector().predict(frame(bar(angle)))
    row, col = best(found)
    apart = (float(found.angle[row, col]) - (angle + np.pi / 2) + np.pi / 2) % np.pi - np.pi / 2
    assert abs(apart) < np.deg2rad(4)
    point = found.world_points()[row, col]
    centre = found.T_world_camera[:2, 3]
    assert np.linalg.norm(point[:2] - centre) < 0.005
    opening = float(found.world_width()[row, col])
    assert 0.03 < opening < 0.03 + 2 * HeuristicConfig().clearance + 0.006


def test_a_stick_as_thin_as_the_noise_is_not_seen_and_a_thicker_one_is() -> None:
    thin, thick = (
        HeuristicDetector().predict(frame(bar(0.3, breadth=0.018, height=h))) for h in (0.0005, 0.006)
    )
    assert thin.quality.max() < 0.1
    assert thick.quality.max() > 0.5


def test_what_is_too_broad_for_the_hand_is_left_alone() -> None:
    assert HeuristicDetector().predict(frame(bar(0.0, length=0.12, breadth=0.09))).quality.max() == 0


def test_an_opening_is_never_wider_than_the_hand() -> None:
    found = HeuristicDetector().predict(frame(bar(0.0, length=0.12, breadth=0.075)))
    assert 0.070 < found.world_width()[found.quality > 0].max() <= 0.081


def test_of_two_pieces_each_has_a_grasp_and_small_ones_have_none() -> None:
    depth = np.full((480, 640), TABLE)
    depth[200:215, 250:290] -= 0.02
    depth[260:300, 360:375] -= 0.02
    depth[230, 330] -= 0.02
    found = HeuristicDetector().predict(frame(depth + np.random.default_rng(1).normal(0, NOISE, depth.shape)))
    left, right = (found.quality[:, :112].max(), found.quality[:, 112:].max())
    assert min(left, right) > 0.5
    assert found.quality[100:125, 105:135].max() == 0


def test_it_takes_no_weights_and_no_unusable_settings() -> None:
    with pytest.raises(ConfigError, match="the heuristic has no weights"):
        make_detector("heuristic", "some.pt")
    for change in ({"crop": 0}, {"min_area": 0}, {"deviations": -1.0}, {"clearance": float("nan")}):
        with pytest.raises(ConfigError, match="unusable heuristic settings"):
            HeuristicConfig(**change)


def test_its_settings_have_an_effect() -> None:
    image = frame(bar(0.3, height=0.003))
    assert HeuristicDetector().predict(image).quality.max() > 0
    assert HeuristicDetector(HeuristicConfig(min_height=0.01)).predict(image).quality.max() == 0
    assert HeuristicDetector(HeuristicConfig(deviations=500.0)).predict(image).quality.max() == 0
    assert HeuristicDetector(HeuristicConfig(min_area=100_000)).predict(image).quality.max() == 0
