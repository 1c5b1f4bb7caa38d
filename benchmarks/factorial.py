"""A two-level fractional factorial of eight factors in 16 runs, and the effects that come out of it.

The design is 2^(8-4) of resolution IV: the factors A, B, C and D take all 16 combinations of their levels,
and the others follow from them by the generators E = BCD, F = ACD, G = ABC and H = ABD. The defining relation
has 14 words of four letters, among them BCDE, ACDF, ABCG and ABDH, and ABCDEFGH. So no main effect is aliased
with another one or with an interaction of two factors, only with those of three and more; the 28 interactions
of two factors stand in seven groups of four, of which only the sum can be seen.

Every world is met in all runs. The effect of a factor in one world is its mean at the high level less that at
the low one, over eight runs each, so that the world itself drops out; intervals (bootstrap) and tests go
over worlds. With fewer than about 20 worlds the intervals are a little too narrow.

References:
    Box, Hunter and Hunter, Statistics for Experimenters, chapter 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.statistics import RESAMPLES, holm, mean_interval

LETTERS = "ABCDEFGH"
GENERATORS = {"E": "BCD", "F": "ACD", "G": "ABC", "H": "ABD"}
"""Columns of the design that are products of others."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """Difference that a factor makes, or the sum of those of some interactions, with a 95 % interval."""

    name: str
    """Letter of the factor, or the interactions of the group as AB + CG + ..."""
    n: int
    """Worlds."""
    effect: float
    """Mean over worlds; NaN where there is none."""
    low: float
    high: float
    p: float
    """Two-sided p of the sign-flip permutation test over worlds, exact up to 13 of them."""
    p_holm: float = np.nan
    """Corrected after Holm over the eight factors; NaN for interactions."""


def design() -> FloatArray:
    """Return the levels (16, 8) of the factors A to H in each run, -1 or 1; all are low in the first run."""
    columns = dict(zip("DCBA", np.array(list(product((-1.0, 1.0), repeat=4))).T, strict=True))
    for letter, parents in GENERATORS.items():
        columns[letter] = np.prod([columns[parent] for parent in parents], axis=0)
    return np.stack([columns[letter] for letter in LETTERS], axis=1)


def alias_groups() -> list[tuple[str, ...]]:
    """Return the interactions of two factors in groups that the design cannot tell apart, as AB, CG, ..."""
    levels, groups = design(), dict[bytes, list[str]]()
    for a, b in combinations(range(len(LETTERS)), 2):
        column = levels[:, a] * levels[:, b]
        groups.setdefault(column.tobytes(), []).append(LETTERS[a] + LETTERS[b])
    return [tuple(group) for group in groups.values()]


def main_effects(response: FloatArray) -> list[Effect]:
    """Return the effects of A to H on a response (16, n) of all runs in n worlds."""
    found = [_effect(letter, column, response) for letter, column in zip(LETTERS, design().T, strict=True)]
    corrected = holm([effect.p for effect in found])
    return [replace(effect, p_holm=p) for effect, p in zip(found, corrected, strict=True)]


def interactions(response: FloatArray) -> list[Effect]:
    """Return the summed effects of each group of interactions on a response (16, n); p is not corrected."""
    levels = dict(zip(LETTERS, design().T, strict=True))
    return [
        _effect(" + ".join(group), levels[group[0][0]] * levels[group[0][1]], response)
        for group in alias_groups()
    ]


def _effect(name: str, column: FloatArray, response: FloatArray) -> Effect:
    of_worlds = 2 * column @ response / len(column)  # (n,)
    mean, low, high = mean_interval(of_worlds)
    return Effect(name=name, n=len(of_worlds), effect=mean, low=low, high=high, p=_sign_flip(of_worlds))


def _sign_flip(values: Sequence[float] | FloatArray) -> float:
    """Return how often the mean of values whose signs are flipped at random is as far from 0, or farther."""
    from scipy.stats import permutation_test

    sample = np.asarray(values, float)
    if len(sample) < 2 or not np.any(sample):
        return 1.0
    found = permutation_test(
        (sample,),
        np.mean,
        permutation_type="samples",
        n_resamples=RESAMPLES,
        rng=np.random.default_rng(0),
    )
    return float(found.pvalue)
