"""Laws of what may be looked at at any time: it errs no more often than it says, ever."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import beta

from mpgrasp.anytime import confidence_sequence, log_e_value, log_mixture
from mpgrasp.exceptions import ConfigError
from mpgrasp.statistics import mcnemar, wilson_interval


@pytest.mark.parametrize(("k", "m"), [(0, 0), (1, 0), (3, 2), (0, 9), (12, 5)])
def test_the_mixture_is_the_mean_likelihood_over_all_rates(k: int, m: int) -> None:
    def likelihood(angle: float) -> float:  # by rate = sin2(angle), of which the prior is uniform
        return float(np.sin(angle) ** (2 * k) * np.cos(angle) ** (2 * m)) * 2 / np.pi

    mean, _ = quad(likelihood, 0, np.pi / 2)
    assert math.exp(log_mixture(k, m)) == pytest.approx(mean, rel=1e-6)
    assert math.exp(log_mixture(k, m)) == pytest.approx(beta(k + 0.5, m + 0.5) / np.pi)


def test_an_e_value_is_fair_if_both_are_equally_good() -> None:
    for a in range(5):
        for b in range(5):
            now = math.exp(log_e_value(a, b))
            later = (math.exp(log_e_value(a + 1, b)) + math.exp(log_e_value(a, b + 1))) / 2
            assert later == pytest.approx(now), "no bet on a fair coin gains or loses on average"
    assert log_e_value(0, 0) == pytest.approx(0.0)


def known_after(first: np.ndarray, second: np.ndarray) -> int | None:
    """Return after how many worlds one of two methods is known to be better; None if it never is."""
    a_alone, b_alone = (first & ~second).cumsum(), (second & ~first).cumsum()
    limit, counts = -math.log(0.05), zip(a_alone, b_alone, strict=True)
    return next((n for n, (a, b) in enumerate(counts, 1) if log_e_value(int(a), int(b)) >= limit), None)


def test_equal_methods_are_called_different_at_any_time_in_at_most_one_of_twenty_races() -> None:
    rng, alarms = np.random.default_rng(0), 0
    for _ in range(1000):
        first, second = rng.random((2, 300)) < 0.8
        alarms += known_after(first, second) is not None
    assert alarms / 1000 <= 0.05 + 0.014  # two standard errors


def test_a_clear_difference_is_found_in_fewer_episodes_than_a_fixed_number_needs() -> None:
    rng, needed, powerful = np.random.default_rng(1), [], 0
    for _ in range(300):
        first, second = rng.random(400) < 0.95, rng.random(400) < 0.6
        found = known_after(first, second)
        assert found is not None
        needed.append(found)
        powerful += mcnemar(int((first & ~second)[:60].sum()), int((second & ~first)[:60].sum())) < 0.05
    assert np.mean(needed) < 40
    assert powerful / 300 > 0.95, "60 worlds are what a test of a fixed number takes to be as sure of it"


def test_a_confidence_sequence_holds_the_rate_at_all_times_at_once() -> None:
    rng, missed = np.random.default_rng(2), 0
    for _ in range(300):
        rate = rng.uniform(0.05, 0.95)
        successes = (rng.random(200) < rate).cumsum()
        looks = (confidence_sequence(int(k), n) for n, k in enumerate(successes, 1))
        missed += any(not low <= rate <= high for low, high in looks)
    assert missed / 300 <= 0.05 + 0.025


def test_wilson_s_interval_does_not() -> None:
    rng, missed = np.random.default_rng(3), 0
    for _ in range(100):
        successes = (rng.random(200) < 0.8).cumsum()
        looks = (wilson_interval(int(k), n) for n, k in enumerate(successes, 1))
        missed += any(not low <= 0.8 <= high for low, high in looks)
    assert missed / 100 > 0.15


def test_a_confidence_sequence_narrows_around_what_was_seen_and_is_wider_than_wilson_s() -> None:
    widths = []
    for n in (10, 40, 160, 640):
        low, high = confidence_sequence(n * 8 // 10, n)
        assert low < 0.8 < high
        a, b = wilson_interval(n * 8 // 10, n)
        assert high - low > b - a
        widths.append(high - low)
    assert all(after < before for before, after in pairwise(widths))


def test_a_confidence_sequence_is_the_same_mirrored() -> None:
    low, high = confidence_sequence(17, 20)
    mirrored = confidence_sequence(3, 20)
    assert np.allclose([1 - high, 1 - low], mirrored)
    assert confidence_sequence(20, 20)[1] == 1.0
    assert confidence_sequence(0, 20)[0] == 0.0
    assert confidence_sequence(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(("k", "n"), [(3, 2), (-1, 2)])
def test_impossible_counts_are_refused(k: int, n: int) -> None:
    with pytest.raises(ConfigError, match="impossible counts"):
        confidence_sequence(k, n)
    with pytest.raises(ConfigError, match="impossible counts"):
        log_mixture(-1, 2)
