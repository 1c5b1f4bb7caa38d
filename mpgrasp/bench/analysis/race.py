"""Races: two methods over the same worlds until one is known to be better, whenever one looks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mpgrasp.anytime import log_e_value
from mpgrasp.bench.record import Cell, Cells, ErrorLine, Line, Method, Record


class RaceCard(Record, frozen=True, kw_only=True):
    """Two methods, and when their race ends."""

    first: str
    """DETECTOR/CONTROLLER"""
    second: str
    alpha: float
    """Probability, at most, of calling two methods different that are equally good."""
    max_episodes: int
    """Where the race ends in any case."""
    step: int
    """Episodes between two looks."""


@dataclass(frozen=True, kw_only=True)
class RaceState:
    """How a race stands."""

    card: RaceCard
    pairs: int
    """Worlds that both have played."""
    both: int
    a_alone: int
    b_alone: int
    """Worlds in which both, the first one alone, or the second one alone succeeded."""
    log_e: float
    """Greatest logarithm of the e-value so far, against both being equally good."""

    @property
    def decided(self) -> bool:
        """True once one is known to be better."""
        return self.log_e >= -math.log(self.card.alpha)

    @property
    def winner(self) -> str | None:
        """The better one, once that is known."""
        if not self.decided:
            return None
        return self.card.first if self.a_alone > self.b_alone else self.card.second

    @property
    def p(self) -> float:
        """Bound on p that holds whenever the race is looked at."""
        return min(1.0, math.exp(-self.log_e))

    def __str__(self) -> str:
        a, b = self.both + self.a_alone, self.both + self.b_alone
        counts = (
            f"after {self.pairs} worlds {self.card.first} has {a} successes, {self.card.second} {b}; "
            f"alone {self.a_alone} and {self.b_alone}; p at most {self.p:.2g}, whenever one stops"
        )
        if self.winner is not None:
            return f"{self.winner} is better: {counts}"
        return f"not decided: {counts}"


def state_of(card: RaceCard, suite: str, cells: Cells, most: int | None = None) -> RaceState:
    """Return how a race stands by the episodes of a suite, those before `most` alone if it is given."""
    first, second = (
        _successes(cells.get(Cell(suite, *method_named(name)), ()), most)
        for name in (card.first, card.second)
    )
    both = a_alone = b_alone = 0
    log_e = 0.0
    common = sorted(first.keys() & second.keys())
    for episode in common:
        a, b = first[episode], second[episode]
        both, a_alone, b_alone = both + (a and b), a_alone + (a and not b), b_alone + (b and not a)
        log_e = max(log_e, log_e_value(a_alone, b_alone))
    return RaceState(card=card, pairs=len(common), both=both, a_alone=a_alone, b_alone=b_alone, log_e=log_e)


def _successes(lines: Sequence[Line], most: int | None) -> dict[int, bool]:
    return {
        line.episode: line.success
        for line in lines
        if not isinstance(line, ErrorLine) and (most is None or line.episode < most)
    }


def method_named(name: str) -> Method:
    """Return the method that a name means, DETECTOR/CONTROLLER."""
    detector, _, controller = name.partition("/")
    return Method(detector, controller)
