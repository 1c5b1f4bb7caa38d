from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from itertools import combinations, product

import numpy as np
import pytest
import scipy.stats

from mpgrasp import statistics
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.statistics import (
    FEWEST_PAIRS,
    MOST_RESAMPLED,
    holm,
    mcnemar,
    mean_interval,
    median_interval,
    restricted,
    smallest_p,
    wilcoxon,
    wilson_interval,
)


@pytest.mark.parametrize(("successes", "n"), [(0, 10), (10, 10), (7, 10), (60, 100), (1, 3)])
def test_wilson_bounds_lie_where_the_score_test_just_rejects(successes: int, n: int) -> None:
    # independent of scipy: at a bound p, |rate - p| equals z standard errors under p
    z = 1.959963984540054
    low, high = wilson_interval(successes, n)
    assert (low == pytest.approx(0, abs=1e-12), high == 1) == (successes == 0, successes == n)
    for p in (low, high):
        if 1e-12 < p < 1:
            assert abs(successes / n - p) == pytest.approx(z * math.sqrt(p * (1 - p) / n), rel=1e-6)


def test_wilson_interval_holds_the_rate_and_stays_within_zero_and_one() -> None:
    for n in (1, 5, 40):
        for successes in range(n + 1):
            low, high = wilson_interval(successes, n)
            assert 0 <= low <= successes / n <= high <= 1


def test_nothing_tried_says_nothing() -> None:
    assert wilson_interval(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(("successes", "n"), [(3, 2), (-1, 2)])
def test_impossible_counts_are_refused(successes: int, n: int) -> None:
    with pytest.raises(ConfigError):
        wilson_interval(successes, n)


def exact_p(a: int, b: int) -> float:
    """Sum of the probabilities of all outcomes that are no more likely than this one."""
    n = a + b
    weights = [math.comb(n, k) for k in range(n + 1)]
    return float(sum(w for w in weights if w <= weights[a]) / 2**n)


@pytest.mark.parametrize(("a", "b"), [(0, 0), (1, 0), (5, 0), (2, 9), (9, 2), (4, 4), (10, 25)])
def test_mcnemar_is_the_sum_of_what_is_as_unlikely(a: int, b: int) -> None:
    assert mcnemar(a, b) == pytest.approx(exact_p(a, b))


def test_holm_is_closed_testing_with_bonferroni() -> None:
    # by definition: a hypothesis falls if every set of hypotheses that holds it is rejected
    rng = np.random.default_rng(0)
    for size in (1, 2, 5):
        p = rng.uniform(0, 0.3, size)
        sets = [s for k in range(1, size + 1) for s in combinations(range(size), k)]
        for i, corrected in enumerate(holm([float(value) for value in p])):
            closed = max(min(1.0, len(s) * min(p[j] for j in s)) for s in sets if i in s)
            assert corrected == pytest.approx(closed)


def test_no_tests_no_correction() -> None:
    assert holm([]) == []


def test_the_bootstrap_of_as_many_ones_as_zeros_is_binomial() -> None:
    # symmetric, so that nothing is corrected: the bounds are quantiles of Binomial(16, 1/2) / 16
    share = [sum(math.comb(16, k) for k in range(up_to + 1)) / 2**16 for up_to in range(17)]
    low = next(k for k, p in enumerate(share) if p >= 0.025)
    assert mean_interval([0.0, 1.0] * 8) == (0.5, low / 16, 1 - low / 16)


@pytest.mark.parametrize(
    "gain", [[3.0, -1.0, 2.0, 5.0], [1.0, 2.0, 3.0, 4.0, 5.0, -6.0], [-1.0, -2.0], [1.0], [1.0, 2.0, -3.0]]
)
def test_the_signed_rank_test_counts_the_signs_that_are_as_extreme(gain: list[float]) -> None:
    order = sorted(gain, key=abs)
    ranks = range(1, len(gain) + 1)
    middle = sum(ranks) / 2
    off = sum(r for r, value in zip(ranks, order, strict=True) if value > 0) - middle
    sums = [
        sum(r for r, up in zip(ranks, ups, strict=True) if up) for ups in product((0, 1), repeat=len(gain))
    ]
    p, positive = wilcoxon(gain)
    assert p == pytest.approx(sum(abs(total - middle) >= abs(off) for total in sums) / len(sums))
    assert positive is (off > 0)
    assert wilcoxon([0.0, 0.0]) == (1.0, False)


def test_no_paired_test_is_below_the_smallest_p_and_six_pairs_are_the_fewest() -> None:
    for n in range(1, 8):
        assert wilcoxon(np.arange(1.0, n + 1))[0] == pytest.approx(smallest_p(n))
        assert min(mcnemar(k, m) for k in range(n + 1) for m in range(n + 1 - k)) == smallest_p(n)
    assert (smallest_p(0), smallest_p(5) > 0.05, smallest_p(6) < 0.05, FEWEST_PAIRS) == (1.0, True, True, 6)


@pytest.mark.parametrize("pair", [(0, 1), (3, 9), (9, 3), (50, 50), (400, 600), (401, 600), (999, 1)])
def test_mcnemars_p_is_that_of_scipys_binomial_test(pair: tuple[int, int]) -> None:
    assert mcnemar(*pair) == pytest.approx(scipy.stats.binomtest(pair[0], sum(pair)).pvalue, rel=1e-12)


@pytest.mark.parametrize("n", [2, 3, 10, 100, 700])
@pytest.mark.parametrize("law", ["normal", "exponential", "laplace"])
def test_bootstrap_intervals_are_those_of_scipy(n: int, law: str) -> None:
    values = 5 + getattr(np.random.default_rng(n), law)(size=n)
    for found, statistic, method in (
        (mean_interval(values), np.mean, "BCa"),
        (median_interval(values), np.median, "percentile"),
    ):
        known = scipy.stats.bootstrap(
            (values,), statistic, method=method, rng=np.random.default_rng(0)
        ).confidence_interval
        assert found == pytest.approx((statistic(values), known.low, known.high), rel=1e-12)


def test_a_bootstrap_interval_is_the_same_every_time_and_needs_two_values() -> None:
    assert mean_interval([1.0, 2.0, 4.0]) == mean_interval([1.0, 2.0, 4.0])
    assert mean_interval([2.0, 2.0]) == (2.0, 2.0, 2.0)
    assert np.isnan(mean_interval([2.0])[1:]).all()
    assert np.isnan(mean_interval([])).all()


def test_restricted_times_are_cut_off_at_the_limit() -> None:
    assert restricted([1.0, 5.0, 9.0], 6.0).tolist() == [1.0, 5.0, 6.0]
    assert restricted([1.0, 9.0], None).tolist() == [1.0, 9.0]


SKEWED = np.random.default_rng(0).lognormal(0, 1, MOST_RESAMPLED)


@pytest.mark.parametrize(("interval", "apart"), [(mean_interval, 0.03), (median_interval, 0.08)])
def test_many_values_have_the_interval_that_resampling_gives(
    interval: Callable[[FloatArray], tuple[float, float, float]],
    apart: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    centre, *resampled = interval(SKEWED)
    monkeypatch.setattr(statistics, "MOST_RESAMPLED", 10)
    same, *by_formula = interval(SKEWED)
    assert same == centre
    assert by_formula == pytest.approx(resampled, abs=apart * (resampled[1] - resampled[0]))


@pytest.mark.parametrize(
    ("interval", "truth"), [(mean_interval, 1.0), (median_interval, math.log(2))], ids=["mean", "median"]
)
def test_intervals_of_many_values_hold_the_truth_as_often_as_they_say(
    interval: Callable[[FloatArray], tuple[float, float, float]], truth: float
) -> None:
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(1000):
        _, low, high = interval(rng.exponential(1.0, MOST_RESAMPLED + 1))
        held += low <= truth <= high
    assert 0.93 <= held / 1000 <= 0.97


def test_the_interval_of_many_skewed_values_is_halls() -> None:
    n, z = 2500, 1.959963985
    sample = np.random.default_rng(2).lognormal(0, 1, n)
    deviations = sample - sample.mean()
    sd = math.sqrt(np.mean(deviations**2))
    skewness = np.mean(deviations**3) / sd**3
    shift = sd / n * skewness * (2 * z**2 + 1) / 6
    half = z * sd / math.sqrt(n)
    _, low, high = mean_interval(sample)
    assert (low, high) == pytest.approx(
        (sample.mean() + shift - half, sample.mean() + shift + half), rel=1e-6
    )


def test_few_values_are_resampled() -> None:
    few = [1.0, 2.0, 2.0, 3.0, 9.0, 2.5, 3.0, 4.0]
    middle, low, high = median_interval(few)
    rng = np.random.default_rng(5)
    medians = np.median(rng.choice(few, (20_000, len(few))), axis=1)
    assert (middle, low, high) == pytest.approx((2.75, *np.quantile(medians, (0.025, 0.975))), abs=0.3)


def test_many_equal_values_have_no_width() -> None:
    same = np.full(MOST_RESAMPLED + 1, 7.0)
    assert mean_interval(same) == median_interval(same) == (7.0, 7.0, 7.0)


def test_a_million_values_take_little_memory() -> None:
    values = np.random.default_rng(0).random(1_000_000)
    tracemalloc.start()
    try:
        mean_interval(values)
        median_interval(values)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 10 * values.nbytes
