"""Intervals and tests for success rates and times.

Rates: Wilson's score interval; McNemar's exact test for two cells that met the same worlds; Holm's
correction (Scandinavian Journal of Statistics 6, 1979) where several tests stand in one table. Paired
times: Wilcoxon's signed-rank test (Biometrics Bulletin 1, 1945). Times of one cell: bias-corrected and
accelerated bootstrap (Efron 1987) of the mean, restricted to the time limit where one was hit: with one limit
for all, that is the mean of min(time, limit), and no time is lost by censoring.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import count
from statistics import NormalDist
from typing import Any

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray

CONFIDENCE = 0.95
SIGNIFICANCE = 0.05
"""A corrected p below this is called significant."""
RESAMPLES = 9999
"""Number of resamples of the bootstrap; its generator always starts from the same seed."""
MOST_COUNTED = 1000
"""Up to so many coins the outcomes are counted; beyond, scipy has the binomial distribution."""
MOST_RESAMPLED = 2000
"""More values than these are not resampled; the bounds by formula then differ by hundredths of the width."""


def wilson_interval(successes: int, n: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return Wilson's score interval (low, high) of a success rate; (0, 1) where nothing was tried.

    scipy has it, and takes a second to be imported for these four lines.

    Raises:
        ConfigError: more successes than trials, or negative counts.
    """
    if not 0 <= successes <= n:
        raise ConfigError("impossible counts", got=(successes, n), allowed="0 <= successes <= n")
    if n == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf((1 + confidence) / 2)
    rate, spread = successes / n, z * z / n
    centre = (rate + spread / 2) / (1 + spread)
    half = math.sqrt(spread * (rate * (1 - rate) + spread / 4)) / (1 + spread)
    return (0.0 if successes == 0 else centre - half), (1.0 if successes == n else centre + half)


def mcnemar(a_alone: int, b_alone: int) -> float:
    """Return the two-sided p of McNemar's exact test on pairs in which A alone and B alone succeeded."""
    if min(a_alone, b_alone) < 0:
        raise ConfigError("impossible counts", got=(a_alone, b_alone), allowed="0 or more")
    discordant, fewer = a_alone + b_alone, min(a_alone, b_alone)
    if not discordant:
        return 1.0
    if discordant > MOST_COUNTED:
        from scipy.stats import binomtest

        return float(binomtest(a_alone, discordant, 0.5).pvalue)
    tail = sum(math.comb(discordant, k) for k in range(fewer + 1))
    return float(min(1.0, tail / 2 ** (discordant - 1)))


def wilcoxon(gain: Sequence[float] | FloatArray) -> tuple[float, bool]:
    """Return the two-sided p of Wilcoxon's signed-rank test on differences; True if they lean above 0."""
    from scipy.stats import wilcoxon as signed_rank

    values = np.asarray(gain, float)
    if not np.any(values):
        return 1.0, False
    up, down = (float(signed_rank(values, alternative=side).pvalue) for side in ("greater", "less"))
    return float(signed_rank(values).pvalue), up < down


def smallest_p(n: int) -> float:
    """Return the smallest two-sided p of either exact paired test with n pairs: all n differ one way."""
    return min(1.0, 2.0 ** (1 - n))


FEWEST_PAIRS = next(n for n in count() if smallest_p(n) < SIGNIFICANCE)
"""With fewer pairs no paired test is significant, whatever comes out."""


def holm(p: Sequence[float]) -> list[float]:
    """Return Holm's corrected p of a family of tests, in the order given.

    scipy has the false discovery rate only, and statsmodels would bring pandas for these three lines.
    """
    values = np.asarray(p, float)
    order = np.argsort(values, kind="stable")
    corrected = np.empty(len(values))
    factors = np.arange(len(values), 0, -1)
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(values[order] * factors))
    return [float(value) for value in corrected]


def mean_interval(
    values: Sequence[float] | FloatArray, confidence: float = CONFIDENCE
) -> tuple[float, float, float]:
    """Return the mean with its bootstrap interval: (mean, low, high); bounds are NaN below two values.

    Of more than `MOST_RESAMPLED` values it is the normal interval with Edgeworth's correction for skewness
    (Hall, The Bootstrap and Edgeworth Expansion, 1992): resampling takes gigabytes to say the same.
    """
    sample = np.asarray(values, float)
    if len(sample) <= MOST_RESAMPLED:
        return _bootstrap(sample, np.mean, confidence, corrected=True)
    from scipy.stats import norm, skew

    n, centre, deviation = len(sample), float(sample.mean()), float(sample.std())
    z = float(norm.ppf((1 + confidence) / 2))
    half = z * deviation / math.sqrt(n)
    shift = float(skew(sample)) * (1 + 2 * z * z) / 6 * deviation / n if deviation > 0 else 0.0
    return centre, centre + shift - half, centre + shift + half


def median_interval(
    values: Sequence[float] | FloatArray, confidence: float = CONFIDENCE
) -> tuple[float, float, float]:
    """Return the median with its bootstrap interval, as `mean_interval`.

    The interval is by percentiles: a median has too few different values for the correction's jackknife. Of
    more than `MOST_RESAMPLED` values it is the one between two order statistics, by the binomial distribution
    of the number of values below the median.
    """
    sample = np.asarray(values, float)
    if len(sample) <= MOST_RESAMPLED:
        return _bootstrap(sample, np.median, confidence, corrected=False)
    from scipy.stats import binom

    n = len(sample)
    below = int(binom.ppf((1 - confidence) / 2, n, 0.5))
    low, high = np.partition(sample, (below - 1, n - below))[[below - 1, n - below]]
    return float(np.median(sample)), float(low), float(high)


def _bootstrap(
    sample: FloatArray, statistic: Callable[..., Any], confidence: float, *, corrected: bool
) -> tuple[float, float, float]:
    """Return a statistic of a sample (n,) with the interval that resampling gives it.

    As scipy's `bootstrap`, to the last digits but one; scipy.stats takes longer to be imported than a run of
    one method takes for its summary.

    Args:
        sample: values.
        statistic: of the last axis, as numpy has it.
        confidence: of the interval.
        corrected: for bias and acceleration (BCa), in place of plain percentiles.
    """
    n = len(sample)
    if not n:
        return np.nan, np.nan, np.nan
    centre = float(statistic(sample))
    if n == 1:
        return centre, np.nan, np.nan
    if np.ptp(sample) == 0:
        return centre, centre, centre  # every resample is the same, which BCa cannot divide by
    resampled = statistic(sample[np.random.default_rng(0).integers(0, n, (RESAMPLES, n))], axis=-1)
    tail = (1 - confidence) / 2
    shares = (tail, 1 - tail)
    if corrected:
        without = statistic(np.array([np.delete(sample, k) for k in range(n)]), axis=-1)
        pull = without.mean() - without
        acceleration = float((pull**3).sum() / (pull**2).sum() ** 1.5) / 6
        below = float(((resampled < centre).mean() + (resampled <= centre).mean()) / 2)
        shares = _corrected(shares, below, acceleration)
    low, high = np.quantile(resampled, shares)
    return centre, float(low), float(high)


def _corrected(shares: tuple[float, float], below: float, acceleration: float) -> tuple[float, float]:
    """Return the shares of the bootstrap's distribution to cut at (Efron 1987), for those wanted.

    Args:
        shares: wanted of a distribution without bias and skew.
        below: share of the resamples below the statistic itself.
        acceleration: how its standard error changes with its value.
    """
    normal = NormalDist()
    bias = normal.inv_cdf(below)

    def cut(share: float) -> float:
        shifted = bias + normal.inv_cdf(share)
        return normal.cdf(bias + shifted / (1 - acceleration * shifted))

    return cut(shares[0]), cut(shares[1])


def restricted(times: Sequence[float] | FloatArray, limit: float | None) -> FloatArray:
    """Return times cut off at the limit, if there is one: their mean is the restricted mean time."""
    values = np.asarray(times, float)
    return values if limit is None else np.minimum(values, limit)
