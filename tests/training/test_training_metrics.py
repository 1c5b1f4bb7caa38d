"""Laws of the agreement between a network's best grasp and the labels."""

from __future__ import annotations

import numpy as np
import pytest
from toy_training import toy_sample

from mpgrasp.training.metrics import match_labels


@pytest.mark.parametrize(
    ("turn", "widen", "hit", "rectangle"),
    [(0.0, 1.0, True, True), (0.4, 1.0, True, True), (0.6, 1.0, False, False), (0.0, 0.7, False, True)],
)
def test_the_match_follows_angle_and_opening(turn: float, widen: float, hit: bool, rectangle: bool) -> None:
    truth = toy_sample(4)
    match = match_labels(
        truth.quality, truth.angle + np.float32(turn), truth.width * np.float32(widen), truth
    )
    assert (match.hit, match.rectangle) == (hit, rectangle)


def test_a_grasp_beside_the_object_is_no_hit() -> None:
    truth = toy_sample(4)
    quality = np.zeros_like(truth.quality)
    quality[1, 1] = 1.0
    assert not match_labels(quality, truth.angle, truth.width, truth).hit
