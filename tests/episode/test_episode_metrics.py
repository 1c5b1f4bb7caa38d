from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mpgrasp.episode.metrics import DETECTION_QUALITY, ReachMetrics, spectral_arc_length
from mpgrasp.geometry import FloatArray

RATE = 100.0


def bell(duration: float) -> FloatArray:
    """Speed of a minimum-jerk movement over 1 m."""
    s = np.arange(0.0, 1.0, 1.0 / (RATE * duration))
    return 30.0 * s**2 * (1 - s) ** 2 / duration


def test_a_minimum_jerk_movement_has_the_published_arc_length() -> None:
    # -1.41 in figure 2 of the paper
    assert spectral_arc_length(bell(1.0), RATE) == pytest.approx(-1.41, abs=0.01)


def test_arc_length_knows_neither_duration_nor_speed() -> None:
    reference = spectral_arc_length(bell(1.0), RATE)
    assert spectral_arc_length(7.0 * bell(1.0), RATE) == pytest.approx(reference, rel=1e-12)
    assert spectral_arc_length(bell(4.0), RATE) == pytest.approx(reference, abs=0.02)


def test_every_stop_on_the_way_makes_a_movement_less_smooth() -> None:
    values = [spectral_arc_length(np.tile(bell(0.5), k), RATE) for k in (1, 2, 3, 4)]
    assert values == sorted(values, reverse=True)
    assert len(set(values)) == 4


@pytest.mark.parametrize("speed", [np.empty(0), np.ones(1), np.zeros(50)])
def test_what_does_not_move_has_no_smoothness(speed: FloatArray) -> None:
    assert np.isnan(spectral_arc_length(speed, RATE))


def seen(quality: float) -> Any:
    image = np.zeros((20, 20))
    image[8:13, 8:13] = quality
    return SimpleNamespace(quality=image)


def moving(x: float, y: float, z: float) -> Any:
    return SimpleNamespace(
        twist_achieved=np.array([x, y, z, 0.0, 0.0, 0.0]), config=SimpleNamespace(dt=1.0 / RATE)
    )


def test_drift_is_the_horizontal_way_until_the_first_detection() -> None:
    metrics = ReachMetrics()
    for k in range(5):
        metrics.look(0.1 * k, seen(DETECTION_QUALITY + (0.1 if k >= 2 else -0.1)))
        for _ in range(10):
            metrics.tick(moving(0.03, 0.04, -0.05))
    assert metrics.first_detection_s == pytest.approx(0.2)
    assert metrics.blind_drift_m == pytest.approx(0.05 * 0.2)
    assert np.isfinite(metrics.spectral_arc_length)


def test_where_nothing_is_detected_all_of_the_way_is_drift() -> None:
    metrics = ReachMetrics()
    for _ in range(10):
        metrics.look(0.0, seen(0.0))
        metrics.tick(moving(0.1, 0.0, 0.0))
    assert metrics.first_detection_s is None
    assert metrics.blind_drift_m == pytest.approx(0.01)


def test_a_reach_that_is_over_at_once_has_no_smoothness() -> None:
    assert np.isnan(ReachMetrics().spectral_arc_length)
