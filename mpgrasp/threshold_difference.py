"""Which of two methods gets further on a ladder: thresholds over resampled worlds, the same for both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.thresholds import Results, Scale, quantiles


class Difference(NamedTuple):
    """Threshold of one method and that of another, over worlds that both met."""

    ratio: float
    """Of the levels, first over second, on a logarithmic scale; else the first minus the second."""
    low: float
    high: float
    """Bounds of its 95 % interval."""
    p: float
    """Two-sided: how rare so large a difference is among resampled worlds, if there is none."""


def differences(
    scale: Scale, results: Sequence[Results], rate: float, *, resamples: int = 1000, seed: int = 0
) -> dict[tuple[int, int], Difference]:
    """Compare the levels at which methods fall through a success rate, every two of them.

    Worlds are resampled, the same for all methods and at all levels; thresholds beyond the ladder count as
    at its ends, which makes a difference smaller and never larger.

    Args:
        scale: of the levels.
        results: of each method.
        rate: success rate.
        resamples: number of times that worlds are drawn.
        seed: of the drawing.

    Returns:
        The difference by the places of the first and of the second method, the first one being less.
    """
    worlds = sorted({world for of in results for rung in of.values() for world in rung})
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(len(worlds), np.full(len(worlds), 1 / len(worlds)), size=resamples)
    weights = np.vstack([np.ones(len(worlds)), drawn.astype(float)])
    ends = scale.rungs[0], scale.rungs[-1]
    eases = [np.clip(_eases(scale, of, worlds, weights, rate), *ends) for of in results]
    found = {}
    for first, second in combinations(range(len(results)), 2):
        gaps = eases[first] - eases[second]
        gap, spread = float(gaps[0]), float(np.std(gaps[1:], ddof=1))
        told = _told(scale, gap, gap - 1.96 * spread, gap + 1.96 * spread)
        found[first, second] = Difference(*told, p=_two_sided(gap, spread))
    return found


def difference(
    scale: Scale, first: Results, second: Results, rate: float, *, resamples: int = 1000, seed: int = 0
) -> Difference:
    """Compare two methods, as `differences` does several."""
    return differences(scale, (first, second), rate, resamples=resamples, seed=seed)[0, 1]


def _two_sided(gap: float, spread: float) -> float:
    if gap == 0:
        return 1.0
    return math.erfc(abs(gap) / spread / math.sqrt(2)) if spread > 0 else 0.0


def _told(scale: Scale, *gaps: float) -> tuple[float, float, float]:
    """A gap of ease and its bounds, as a ratio or a difference of levels."""
    signed = gaps if scale.harder == "lower" else (-gaps[0], -gaps[2], -gaps[1])
    value, low, high = (float(np.exp(g)) if scale.logarithmic else float(g) for g in signed)
    return value, low, high


def _eases(
    scale: Scale, results: Results, worlds: Sequence[int], weights: FloatArray, rate: float
) -> FloatArray:
    """Median threshold (b,) for b rows of weights of the worlds."""
    place = {world: k for k, world in enumerate(worlds)}
    levels = [level for level in results if results[level]]
    successes = np.zeros((len(weights), len(levels)))
    trials = np.zeros_like(successes)
    for k, level in enumerate(levels):
        of_level = weights[:, [place[world] for world in results[level]]]
        trials[:, k] = of_level.sum(axis=1)
        successes[:, k] = of_level @ np.array([*results[level].values()], float)
    grid, ease = scale.grid, scale.ease(levels)
    parts = []
    for start in range(0, len(weights), 100):
        part = np.s_[start : start + 100]
        posteriors = grid.posteriors(ease, successes[part], trials[part])
        parts.append(quantiles(grid.ease_at(rate), posteriors, (0.5,))[0])
    return np.concatenate(parts)
