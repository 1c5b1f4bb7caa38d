"""Laws of the square that detectors look at: false matches are holes, and nothing else is touched."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors import make_detector
from mpgrasp.detectors.central_square import FALSE_MATCH, FALSE_SHARE, central_square, false_matches
from mpgrasp.geometry import looking_down

SIZE = 224


def table(far: float = 0.9) -> np.ndarray:
    return (far + np.random.default_rng(0).normal(0, 3e-4, (SIZE, SIZE))).astype(np.float32)


def test_a_speck_far_nearer_than_all_else_is_a_false_match_with_holes_around_it_or_without() -> None:
    for gap in (0, 6):
        depth = table()
        depth[: 10 + gap, : 12 + gap] = np.nan
        depth[:10, :12] = 0.45
        false = false_matches(depth)
        assert false is not None
        assert false[:10, :12].all()
        assert false.sum() == 120


@pytest.mark.parametrize(
    ("height", "side"), [(0.9 * FALSE_MATCH, 12), (1.5 * FALSE_MATCH, int(1.1 * np.sqrt(FALSE_SHARE) * SIZE))]
)
def test_what_is_low_or_large_is_none(height: float, side: int) -> None:
    depth = table()
    depth[100 : 100 + side, 80 : 80 + side] -= np.float32(height)
    assert false_matches(depth) is None


def test_an_image_without_any_is_not_copied_and_one_without_depth_has_none() -> None:
    frame = DepthFrame(
        depth=np.full((480, 640), 0.5, np.float32), intrinsics=D435_INTRINSICS,
        T_world_camera=looking_down([0.5, 0.0, 0.5]),
    )  # fmt: skip
    assert false_matches(central_square(frame).depth) is None
    assert false_matches(np.full((64, 64), np.nan, np.float32)) is None


@pytest.mark.parametrize("name", ["heuristic", "ggcnn", "dhrnet"])
def test_no_detector_grasps_a_false_match(name: str) -> None:
    depth = np.full((480, 640), 0.6, np.float32)
    depth += np.random.default_rng(1).normal(0, 3e-4, depth.shape).astype(np.float32)
    depth[200:230, 290:350] -= np.float32(0.03)
    spoilt = depth.copy()
    spoilt[70:100, 150:190] = np.nan
    spoilt[75:90, 155:175] = 0.3
    detector = make_detector(name)
    detector.reset(None)
    best = []
    for image in (depth, spoilt):
        frame = DepthFrame(
            depth=image, intrinsics=D435_INTRINSICS, T_world_camera=looking_down([0.5, 0.0, 0.6])
        )
        found = detector.predict(frame)
        best.append(np.unravel_index(found.quality.argmax(), found.quality.shape))
    (row, col), (other_row, other_col) = best
    assert np.hypot(row - other_row, col - other_col) < 6
