"""Thresholds: how hard a task may get before a method fails, from successes at several levels of it.

The success rate is a logistic function of how easy a level is, below 1 by a small lapse rate: what fails now
and then however easy it is. Its three parameters have a posterior distribution over a grid (as in Schuett et
al., Vision Research 122, 2016), which gives every threshold an interval, tells when one lies beyond the
levels that were played, and takes a few milliseconds, so that worlds can be resampled thousands of times.
psignifit does the same and is under the GPL; a maximum-likelihood fit has no interval where nothing failed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.statistics import CONFIDENCE

LAPSES = (0.0, 0.01, 0.02, 0.03, 0.05, 0.08)
"""Lapse rates of the grid."""
LAPSE_SCALE = 0.02
"""Mean of the exponential prior of the lapse rate."""
MIDDLES, WIDTHS = 121, 15
"""Numbers of places and of widths in the grid."""
MARGIN = 0.5
"""The grid goes beyond the levels by this share of their span on either side."""

Counts = Mapping[float, tuple[int, int]]
"""Successes and trials by level."""
Results = Mapping[float, Mapping[int, bool]]
"""Success by level and world."""


class Threshold(NamedTuple):
    """Level at which the success rate falls through a value; medians and quantiles of the posterior."""

    level: float
    low: float
    high: float
    """Bounds of the 95 % interval; `low` is the smaller number."""


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How levels are ordered, and which are hard."""

    levels: tuple[float, ...]
    """Rungs that may be played, in rising order."""
    logarithmic: bool = False
    """True where the ratio of two levels is what counts."""
    harder: str = "higher"
    """"higher" or "lower": which levels are harder."""

    def __post_init__(self) -> None:
        levels = np.asarray(self.levels, float)
        if len(levels) < 3 or not np.isfinite(levels).all() or not (np.diff(levels) > 0).all():
            raise ConfigError("unusable levels", got=self.levels, allowed="3 or more, in rising order")
        if self.logarithmic and levels[0] <= 0:
            raise ConfigError("logarithm of a level", got=levels[0], allowed="levels above 0")
        if self.harder not in ("higher", "lower"):
            raise ConfigError("unknown direction", got=self.harder, allowed=("higher", "lower"))

    def ease(self, levels: Sequence[float] | FloatArray) -> FloatArray:
        """Return how easy levels are: on a line, the more the easier."""
        values = np.asarray(levels, float)
        values = np.log(values) if self.logarithmic else values
        return values if self.harder == "lower" else -values

    def level(self, ease: float) -> float:
        """Return the level that is so easy."""
        value = ease if self.harder == "lower" else -ease
        return float(np.exp(value)) if self.logarithmic else float(value)

    @property
    def rungs(self) -> FloatArray:
        """How easy the levels are, from the hardest to the easiest."""
        return np.sort(self.ease(self.levels))

    @property
    def by_ease(self) -> tuple[float, ...]:
        """The levels as they were given, from the hardest to the easiest."""
        return self.levels if self.harder == "lower" else self.levels[::-1]

    @cached_property
    def grid(self) -> Grid:
        """Parameters of the curves that may be."""
        return Grid.of(self)


@dataclass(frozen=True, eq=False)
class Grid:
    """Curves that may be, one for each entry of the arrays (g,)."""

    middle: FloatArray
    """How easy a task is that has half of its greatest rate."""
    slope: FloatArray
    lapse: FloatArray
    log_prior: FloatArray

    @classmethod
    def of(cls, scale: Scale) -> Grid:
        """Return the curves for a scale: any place alike, any width alike in its logarithm."""
        rungs = scale.rungs
        span, step = float(rungs[-1] - rungs[0]), float(np.diff(rungs).min())
        middles = rungs[0] - MARGIN * span, rungs[-1] + MARGIN * span
        return cls._spanned(middles, (0.25 * step, span), LAPSES)

    @classmethod
    def _spanned(
        cls, middles: tuple[float, float], widths: tuple[float, float], lapses: Sequence[float]
    ) -> Grid:
        middle, width, lapse = (
            axis.ravel()
            for axis in np.meshgrid(
                np.linspace(*middles, MIDDLES), np.geomspace(*widths, WIDTHS), np.array(lapses), indexing="ij"
            )
        )
        # a width is the way from 10 % to 90 % of the greatest rate
        return cls(middle, 2 * np.log(9) / width, lapse, -lapse / LAPSE_SCALE)

    def around(self, weights: FloatArray) -> Grid:
        """Return a finer grid over those of the curves (g,) that are likely, for many episodes' sake."""
        likely = weights > 1e-5 * weights.max()
        pitch = float(np.diff(np.unique(self.middle)).min())
        widths = 2 * np.log(9) / self.slope[likely]
        factor = float(np.exp(np.diff(np.log(np.unique(2 * np.log(9) / self.slope))).max()))
        middle, lapse = self.middle[likely], self.lapse[likely]
        return self._spanned(
            (float(middle.min()) - pitch, float(middle.max()) + pitch),
            (float(widths.min()) / factor, float(widths.max()) * factor),
            np.linspace(max(float(lapse.min()) - 0.01, 0.0), float(lapse.max()) + 0.01, len(LAPSES)).tolist(),
        )

    def rates(self, ease: FloatArray) -> FloatArray:
        """Return success rates (g, n) at n tasks."""
        exponent = self.slope[:, None] * (ease[None, :] - self.middle[:, None])
        return np.asarray((1 - self.lapse[:, None]) / (1 + np.exp(-np.clip(exponent, -500, 500))))

    def ease_at(self, rate: float) -> FloatArray:
        """Return how easy (g,) a task must be for a rate; infinite where a curve never gets there."""
        share = rate / (1 - self.lapse)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self.middle + np.log(share / (1 - share)) / self.slope
        return np.asarray(np.where(share < 1, found, np.inf))

    def logarithms(self, ease: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return logarithms (g, n) of success and of failure at n tasks."""
        rates = np.clip(self.rates(ease), 1e-9, 1 - 1e-9)
        return np.log(rates), np.log1p(-rates)

    def posteriors(self, ease: FloatArray, successes: FloatArray, trials: FloatArray) -> FloatArray:
        """Return the probability of every curve (b, g) after counts (b, n) at n tasks; each row sums to 1."""
        success, failure = self.logarithms(ease)
        log = successes @ success.T + (trials - successes) @ failure.T + self.log_prior
        weights = np.exp(log - log.max(axis=1, keepdims=True))
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))


class Fit:
    """What successes and failures at some levels say about all levels.

    Args:
        scale: of the levels.
        counts: successes and trials by level.

    Raises:
        ConfigError: a level that is none of the scale's, or impossible counts.
    """

    def __init__(self, scale: Scale, counts: Counts) -> None:
        for level, (successes, trials) in counts.items():
            if level not in scale.levels:
                raise ConfigError("unknown level", got=level, allowed=scale.levels)
            if not 0 <= successes <= trials:
                raise ConfigError("impossible counts", got=(successes, trials), allowed="0 <= successes <= n")
        self.scale = scale
        ease = scale.ease([*counts])
        values = np.array([*counts.values()], float).reshape(len(counts), 2)
        tally = values[None, :, 0], values[None, :, 1]
        self._grid = scale.grid.around(scale.grid.posteriors(ease, *tally)[0])
        self._weights = self._grid.posteriors(ease, *tally)[0]

    def threshold(self, rate: float) -> Threshold:
        """Return the level at which the success rate falls through `rate`."""
        tails = (1 - CONFIDENCE) / 2, 0.5, (1 + CONFIDENCE) / 2
        low, middle, high = quantiles(self._grid.ease_at(rate), self._weights[None], tails)[:, 0]
        bounds = sorted(self.scale.level(_within(self.scale, ease)) for ease in (low, high))
        return Threshold(self.scale.level(_within(self.scale, middle)), *bounds)

    def rates(self, levels: Sequence[float] | FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the success rate at n levels, each (n,): mean, and the bounds of its 95 % interval."""
        rates = self._grid.rates(self.scale.ease(levels))
        bounds = [
            quantiles(column, self._weights[None], ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2))[:, 0]
            for column in rates.T
        ]
        low, high = np.array(bounds).T
        return np.asarray(self._weights @ rates), low, high

    def best_level(self, rates: Sequence[float], batch: int) -> float:
        """Return the level at which `batch` more episodes tell most about the thresholds of success rates.

        Least is the expected variance of those thresholds, by the mean over what may come out: all of a
        batch's numbers of successes, weighted by how likely they are now (as in Kontsevich and Tyler, Vision
        Research 39, 1999, with variance in the place of entropy).
        """
        rungs = self.scale.rungs
        places = [np.clip(self._grid.ease_at(rate), *self._bounds()) for rate in rates]
        success, failure = self._grid.logarithms(rungs)
        expected = []
        for k in range(len(rungs)):
            likelihood = np.exp(
                [s * success[:, k] + (batch - s) * failure[:, k] for s in range(batch + 1)]
            )  # (batch + 1, g), without the binomial coefficient
            joint = likelihood * _binomials(batch)[:, None] * self._weights
            mass = joint.sum(axis=1)
            after = joint / np.maximum(mass, 1e-300)[:, None]
            variance = sum(after @ place**2 - (after @ place) ** 2 for place in places)
            expected.append(float(mass @ variance))
        return self.scale.by_ease[int(np.argmin(expected))]

    def _bounds(self) -> tuple[float, float]:
        rungs = self.scale.rungs
        step = float(np.diff(rungs).mean())
        return float(rungs[0]) - step, float(rungs[-1]) + step


def _within(scale: Scale, ease: float) -> float:
    """Return an ease that is not further beyond the rungs than the grid."""
    rungs = scale.rungs
    span = MARGIN * float(rungs[-1] - rungs[0])
    return float(np.clip(ease, rungs[0] - span, rungs[-1] + span))


def _binomials(n: int) -> FloatArray:
    return np.array([math.comb(n, k) for k in range(n + 1)], float)


def quantiles(values: FloatArray, weights: FloatArray, shares: Sequence[float]) -> FloatArray:
    """Return quantiles (q, b) of values (g,) under b rows of weights (b, g)."""
    order = np.argsort(values, kind="stable")
    summed = np.cumsum(weights[:, order], axis=1)
    places = [np.minimum((summed < share).sum(axis=1), len(values) - 1) for share in shares]
    return np.array([values[order][place] for place in places])
