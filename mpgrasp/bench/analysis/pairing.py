"""Two sets of episodes over the same worlds: who succeeded where, and whether that is chance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mpgrasp.bench.record import ErrorLine, Line, PlayedLine, played
from mpgrasp.exceptions import ConfigError
from mpgrasp.statistics import mcnemar, mean_interval
from mpgrasp.suite import base_name


class World(NamedTuple):
    """One scene with its start pose and sensor noise, which every detector and controller meets alike."""

    suite: str
    """Name without the point of a sweep."""
    seed: int
    episode: int


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


def pair(a: Iterable[Line], b: Iterable[Line]) -> Pairing:
    """Pair the lines of two cells by suite, seed and episode; error rows are counted apart.

    Raises:
        ConfigError: the same episode had another scene in the other run, or occurs twice.
    """
    a, b = list(a), list(b)
    pairs = pair_worlds(a, b)
    errors_a, errors_b = ([line for line in lines if isinstance(line, ErrorLine)] for lines in (a, b))
    lost = ({_world(line) for line in errors_b} & _by_world(a).keys()) - _by_world(b).keys()
    wins = [(one.success, other.success) for one, other in pairs]
    times = [other.sim_time_s - one.sim_time_s for one, other in pairs if one.success and other.success]
    difference, low, high = mean_interval(times)
    a_alone, b_alone = wins.count((True, False)), wins.count((False, True))
    return Pairing(
        n=len(pairs),
        errors_a=len(errors_a),
        errors_b=len(errors_b),
        lost=len(lost),
        both=wins.count((True, True)),
        a_alone=a_alone,
        b_alone=b_alone,
        same_outcome=sum(one.outcome == other.outcome for one, other in pairs),
        identical=sum(one.state_hash == other.state_hash for one, other in pairs),
        p=mcnemar(a_alone, b_alone),
        time_difference_s=difference,
        time_low=low,
        time_high=high,
    )


def pair_worlds(a: Iterable[Line], b: Iterable[Line]) -> list[tuple[PlayedLine, PlayedLine]]:
    """The lines of A and B about the same suite, seed and episode; error rows are left out.

    Raises:
        ConfigError: the same episode had another scene in the other run, or occurs twice.
    """
    ours, theirs = _by_world(a), _by_world(b)
    pairs = [(ours[key], theirs[key]) for key in ours if key in theirs]
    for one, other in pairs:
        if one.scene_seed != other.scene_seed:
            raise ConfigError(
                f"episode {one.episode} of {one.suite} had another scene in the other run",
                got=(one.scene_seed, other.scene_seed),
                allowed="the same scene_seed",
            )
    return pairs


def _by_world(lines: Iterable[Line]) -> dict[World, PlayedLine]:
    worlds: dict[World, PlayedLine] = {}
    for line in played(lines):
        key = _world(line)
        if key in worlds:
            raise ConfigError("an episode occurs twice in one cell", got=tuple(key), allowed="one line each")
        worlds[key] = line
    return worlds


def _world(line: Line) -> World:
    return World(base_name(line.suite), line.seed, line.episode)
