"""Statistics that may be looked at after every episode: they hold at all times at once, whenever one stops.

A bet against the hypothesis is placed on every episode, and the capital that it would have made by now, the
e-value, exceeds 1 / alpha with a probability of at most alpha, ever, if the hypothesis is true (Ville's
inequality). The bets are those of Krichevsky and Trofimov (IEEE Transactions on Information Theory 27,
1981): the odds so far, with half a success and half a failure to begin with. On policies compared in such a
way see Snyder et al., Is Your Imitation Learning Policy Better than Mine? (RSS 2025).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from mpgrasp.exceptions import ConfigError
from mpgrasp.statistics import CONFIDENCE


def log_mixture(successes: int, failures: int) -> float:
    """Return the logarithm of the mean likelihood of an outcome over all rates, by the prior Beta(1/2, 1/2).

    Raises:
        ConfigError: negative counts.
    """
    if min(successes, failures) < 0:
        raise ConfigError("impossible counts", got=(successes, failures), allowed="0 or more")
    half = math.lgamma(0.5)
    return (
        math.lgamma(successes + 0.5)
        + math.lgamma(failures + 0.5)
        - math.lgamma(successes + failures + 1)
        - 2 * half
    )


def log_e_value(a_alone: int, b_alone: int) -> float:
    """Return the logarithm of the e-value against two methods being equally good.

    Args:
        a_alone: episodes in which the first one alone succeeded.
        b_alone: episodes in which the second one alone did.
    """
    return log_mixture(a_alone, b_alone) + (a_alone + b_alone) * math.log(2)


def confidence_sequence(successes: int, n: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return bounds of a success rate that hold at all times at once with this confidence.

    It is every rate against which the e-value has not reached 1 / (1 - confidence).

    Raises:
        ConfigError: more successes than trials, or negative counts.
    """
    if not 0 <= successes <= n:
        raise ConfigError("impossible counts", got=(successes, n), allowed="0 <= successes <= n")
    if n == 0:
        return 0.0, 1.0
    limit = log_mixture(successes, n - successes) + math.log(1 - confidence)

    def kept(rate: float) -> bool:
        return _log_likelihood(successes, n - successes, rate) > limit

    middle = successes / n
    return _edge(kept, middle, 0.0), _edge(kept, middle, 1.0)


def _log_likelihood(successes: int, failures: int, rate: float) -> float:
    parts = ((successes, rate), (failures, 1 - rate))
    return sum(-math.inf if share <= 0 else count * math.log(share) for count, share in parts if count)


def _edge(kept: Callable[[float], bool], inside: float, outside: float) -> float:
    """Return where a condition ends between a place at which it holds and one beyond, by bisection."""
    if kept(outside):
        return outside
    for _ in range(60):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if kept(middle) else (inside, middle)
    return inside
