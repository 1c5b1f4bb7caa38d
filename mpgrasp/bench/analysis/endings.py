"""How the episodes of a cell ended, in arrays: what pairing them with another cell's takes."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpgrasp.bench.record import ErrorLine, Line
from mpgrasp.exceptions import ConfigError
from mpgrasp.suite import base_name

Numbers = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Worlds:
    """Scenes with their start poses and sensor noise, which every detector and controller meets alike."""

    suite: Numbers
    """(n,) of the name without the point of a sweep, in `names`."""
    seed: Numbers
    episode: Numbers
    names: tuple[str, ...]

    def name(self, place: int) -> tuple[str, int, int]:
        """Suite, seed and episode of a world."""
        return self.names[self.suite[place]], int(self.seed[place]), int(self.episode[place])


def common(a: Worlds, b: Worlds) -> tuple[Numbers, Numbers]:
    """Places of the worlds that both have, in the order of A."""
    names = list(dict.fromkeys((*a.names, *b.names)))
    suites = (np.array([names.index(name) for name in side.names], np.int64)[side.suite] for side in (a, b))
    keys = np.zeros(len(a.suite) + len(b.suite), np.int64)
    for columns in (tuple(suites), (a.seed, b.seed), (a.episode, b.episode)):
        values, numbers = np.unique(np.concatenate(columns), return_inverse=True)
        keys = keys * len(values) + numbers
    _, ours, theirs = np.intersect1d(keys[: len(a.suite)], keys[len(a.suite) :], return_indices=True)
    order = np.argsort(ours)
    return ours[order], theirs[order]


@dataclass(frozen=True, kw_only=True, eq=False)
class Endings:
    """Results of played episodes in the order of their lines, and the worlds that could not be played."""

    worlds: Worlds
    place: Numbers
    """(n,) of the line among those of the cell."""
    scene_seed: Numbers
    success: NDArray[np.bool_]
    outcome: Numbers
    """(n,) hash of the outcome."""
    state: Numbers
    """(n,) hash of `state_hash`, within this process."""
    time_s: NDArray[np.float64]
    """(n,) simulated [s]."""
    errors: Worlds

    @classmethod
    def of(cls, lines: Iterable[Line]) -> Endings:
        """Endings of the lines of a cell.

        Raises:
            ConfigError: an episode was played twice.
        """
        names: dict[str, int] = {}
        columns = [array("q") for _ in range(8)]
        times, errors = array("d"), [array("q") for _ in range(3)]
        for place, line in enumerate(lines):
            world = names.setdefault(base_name(line.suite), len(names)), line.seed, line.episode
            if isinstance(line, ErrorLine):
                row: tuple[int, ...] = world
                kept = errors
            else:
                ending = hash(line.outcome), hash(line.state_hash)
                row = (*world, place, line.scene_seed, line.success, *ending)
                kept = columns
                times.append(line.sim_time_s)
            for column, value in zip(kept, row, strict=True):
                column.append(value)
        suite, seed, episode, places, scene_seed, success, outcome, state = map(_integers, columns)
        worlds = Worlds(suite=suite, seed=seed, episode=episode, names=tuple(names))
        _refuse_twice(worlds)
        suite, seed, episode = map(_integers, errors)
        return cls(
            worlds=worlds,
            place=places,
            scene_seed=scene_seed,
            success=success.astype(bool),
            outcome=outcome,
            state=state,
            time_s=np.array(times, float),
            errors=Worlds(suite=suite, seed=seed, episode=episode, names=tuple(names)),
        )


def _integers(values: array[int]) -> Numbers:
    return np.array(values, np.int64)


def _refuse_twice(worlds: Worlds) -> None:
    order = np.lexsort((worlds.episode, worlds.seed, worlds.suite))
    same = np.ones(max(len(order) - 1, 0), bool)
    for column in (worlds.suite, worlds.seed, worlds.episode):
        same &= np.diff(column[order]) == 0
    if same.any():
        twice = worlds.name(int(order[np.flatnonzero(same)[0]]))
        raise ConfigError("an episode occurs twice in one cell", got=twice, allowed="one line each")
