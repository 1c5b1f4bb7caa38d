"""Which rungs are played, and how often: where it tells most, from the results before alone.

Every method begins at the same few rungs over the whole ladder, and goes on in batches where its own results
say that the levels of 50 and of 90 % are found. The same seed gives the same episodes, whatever plays them
and however often a run is interrupted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from mpgrasp.thresholds import Fit, Results, Scale

RATES = (0.5, 0.9)
"""Success rates whose levels are looked for."""


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How many episodes a method gets, and in what portions."""

    scale: Scale
    episodes: int = 200
    """Of each method, on all rungs together."""
    first: int = 8
    """At each rung of the beginning."""
    starts: int = 5
    """Rungs of the beginning, evenly spread, both ends among them."""
    batch: int = 8
    """Episodes that are added at a time, at one rung."""

    @property
    def beginning(self) -> dict[float, int]:
        """Episodes by rung with which every method begins."""
        levels = self.scale.levels
        number = max(min(self.starts, len(levels), self.episodes // self.first), 1)
        places = np.linspace(0, len(levels) - 1, number).round().astype(int)
        return {levels[place]: min(self.first, self.episodes) for place in places}

    def counts(self, results: Results) -> Iterator[dict[float, int]]:
        """Yield the episodes by rung that a method plays, more every time, each when the last are played.

        Args:
            results: success by rung and episode of the method, as far as it was played; it may grow between
                two steps. An episode that could not be played is missing, and counts as played.
        """
        counts = self.beginning
        yield dict(counts)
        while (left := self.episodes - sum(counts.values())) > 0:
            batch = min(self.batch, left)
            rung = Fit(self.scale, _tally(results, counts)).best_level(RATES, batch)
            counts = {**counts, rung: counts.get(rung, 0) + batch}
            yield dict(counts)


def _tally(results: Results, counts: Mapping[float, int]) -> dict[float, tuple[int, int]]:
    """Successes and trials by rung among the first episodes of each."""
    tally = {}
    for rung, number in counts.items():
        of_rung = [success for episode, success in results.get(rung, {}).items() if episode < number]
        tally[rung] = sum(of_rung), len(of_rung)
    return tally
