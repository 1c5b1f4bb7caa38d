"""Two sets of episodes over the same worlds: who succeeded where, and whether that is chance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mpgrasp.bench.analysis.endings import Endings, Numbers, common
from mpgrasp.bench.record import Line, PlayedLine, played
from mpgrasp.exceptions import ConfigError
from mpgrasp.statistics import mcnemar, mean_interval


@dataclass(frozen=True, kw_only=True)
class Pairing:
    """Counts over the episodes that two cells have in common."""

    n: int
    """Worlds that both played."""
    errors_a: int
    """Error rows of A, whether B played these worlds or not."""
    errors_b: int
    lost: int
    """Worlds that A played and of which B has an error row alone."""
    both: int
    """Worlds in which both succeeded."""
    a_alone: int
    b_alone: int
    same_outcome: int
    """Worlds in which both ended the same way."""
    identical: int
    """Worlds that both left in the same state, bit by bit."""
    p: float
    """Two-sided p of McNemar's exact test."""
    time_difference_s: float
    """Mean of B's simulated time minus A's where both succeeded [s]."""
    time_low: float
    time_high: float

    @property
    def rate_a(self) -> float:
        """A's success rate over the worlds that both played; NaN where there are none."""
        return (self.both + self.a_alone) / self.n if self.n else np.nan

    @property
    def rate_b(self) -> float:
        """B's success rate over the worlds that both played; NaN where there are none."""
        return (self.both + self.b_alone) / self.n if self.n else np.nan


def pair(a: Endings | Iterable[Line], b: Endings | Iterable[Line]) -> Pairing:
    """Pair the episodes of two cells by suite, seed and episode; error rows are counted apart.

    Raises:
        ConfigError: the same episode had another scene in the other run, or occurs twice.
    """
    a, b = (side if isinstance(side, Endings) else Endings.of(side) for side in (a, b))
    ours, theirs = _places(a, b)
    win_a, win_b = a.success[ours], b.success[theirs]
    both = win_a & win_b
    difference, low, high = mean_interval((b.time_s[theirs] - a.time_s[ours])[both])
    a_alone, b_alone = int(np.sum(win_a & ~win_b)), int(np.sum(win_b & ~win_a))
    played_by_a, _ = common(a.worlds, b.errors)
    return Pairing(
        n=len(ours),
        errors_a=len(a.errors.suite),
        errors_b=len(b.errors.suite),
        lost=len(np.setdiff1d(played_by_a, ours)),
        both=int(both.sum()),
        a_alone=a_alone,
        b_alone=b_alone,
        same_outcome=int(np.sum(a.outcome[ours] == b.outcome[theirs])),
        identical=int(np.sum(a.state[ours] == b.state[theirs])),
        p=mcnemar(a_alone, b_alone),
        time_difference_s=difference,
        time_low=low,
        time_high=high,
    )


def pair_worlds(a: Sequence[Line], b: Sequence[Line]) -> Iterator[tuple[PlayedLine, PlayedLine]]:
    """The lines of A and B about the same suite, seed and episode; error rows are left out.

    Raises:
        ConfigError: the same episode had another scene in the other run, or occurs twice.
    """
    endings_a, endings_b = Endings.of(a), Endings.of(b)
    ours, theirs = _places(endings_a, endings_b)
    lines_a = played(a[int(place)] for place in endings_a.place[ours])
    lines_b = played(b[int(place)] for place in endings_b.place[theirs])
    yield from zip(lines_a, lines_b, strict=True)


def _places(a: Endings, b: Endings) -> tuple[Numbers, Numbers]:
    """Places of the episodes that both played."""
    ours, theirs = common(a.worlds, b.worlds)
    other = np.flatnonzero(a.scene_seed[ours] != b.scene_seed[theirs])
    if len(other):
        one, two = ours[other[0]], theirs[other[0]]
        suite, _, episode = a.worlds.name(int(one))
        raise ConfigError(
            f"episode {episode} of {suite} had another scene in the other run",
            got=(int(a.scene_seed[one]), int(b.scene_seed[two])),
            allowed="the same scene_seed",
        )
    return ours, theirs
