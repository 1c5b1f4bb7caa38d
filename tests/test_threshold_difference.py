"""Laws of differences: over the same worlds, as often wrong as they say, in the unit of the scale."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from toy_ladders import LEVELS, LINE, STICKS, curve

from mpgrasp.threshold_difference import Difference, difference, differences
from mpgrasp.thresholds import Results


def worlds(rate: Callable[[float], float], n: int, rng: np.random.Generator) -> Results:
    """Success by level and world."""
    return {level: {k: bool(luck < rate(level)) for k, luck in enumerate(rng.random(n))} for level in LEVELS}


def test_equal_results_do_not_differ() -> None:
    results = worlds(curve(1.3, 0.8), 20, np.random.default_rng(6))
    assert difference(STICKS, results, results, 0.5) == Difference(1.0, 1.0, 1.0, 1.0)


def test_several_methods_are_compared_as_two_would_be() -> None:
    rng = np.random.default_rng(9)
    a, b, c = (worlds(curve(middle, 0.6), 30, rng) for middle in (1.2, 1.5, 2.4))
    found = differences(STICKS, (a, b, c), 0.5, resamples=50)
    assert found.keys() == {(0, 1), (0, 2), (1, 2)}
    assert found[0, 1] == difference(STICKS, a, b, 0.5, resamples=50)
    assert found[1, 2] == difference(STICKS, b, c, 0.5, resamples=50)


def test_methods_that_differ_are_told_apart_and_the_quotient_is_that_of_their_levels() -> None:
    rng = np.random.default_rng(7)
    a, b = (worlds(curve(middle, 0.6), 40, rng) for middle in (1.2, 2.4))
    found = difference(STICKS, a, b, 0.5)
    assert found.p < 1e-4
    assert found.low <= 0.5 <= found.high
    back = difference(STICKS, b, a, 0.5)
    assert np.allclose([back.ratio, back.low, back.high], [1 / found.ratio, 1 / found.high, 1 / found.low])


def test_on_a_scale_without_logarithm_a_difference_is_in_its_unit() -> None:
    def results(middle: float, seed: int) -> Results:
        rng = np.random.default_rng(seed)
        return {
            x: {k: bool(rng.random() < 1 / (1 + np.exp(3 * (x - middle)))) for k in range(60)}
            for x in LINE.levels
        }

    found = difference(LINE, results(3.5, 0), results(2.0, 1), 0.5)
    assert found.low <= 1.5 <= found.high
    assert found.low > 0.5


def test_equal_methods_are_called_different_no_more_often_than_the_level_allows() -> None:
    rng = np.random.default_rng(8)
    alarms = 0
    for _ in range(50):
        a, b = (worlds(curve(1.6, 0.9), 15, rng) for _ in range(2))
        alarms += difference(STICKS, a, b, 0.5, resamples=100).p < 0.05
    assert alarms / 50 <= 0.12
