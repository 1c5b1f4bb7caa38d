"""How long a run is going to take, from playing a sample of its episodes as the run would.

The sample is stratified by suite. Another batch of it comes from the suite in which one more episode makes
the forecast better by most for the time it takes (Neyman, Journal of the Royal Statistical Society 97, 1934),
until the forecast is as precise as is wanted.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mpgrasp.bench.playing.crew import Crew
from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import EPISODE, EpisodeError
from mpgrasp.bench.record import ErrorLine, Line, Task
from mpgrasp.statistics import CONFIDENCE
from mpgrasp.suite import Suite, base_name

PRECISE = 0.08
"""Half of the 95 % interval of the whole time over that time, at which a forecast is precise enough."""
FEWEST = 3
"""Episodes of each suite that are played at least, if it has as many."""


@dataclass(frozen=True, kw_only=True)
class Share:
    """What one suite contributes."""

    episodes: int
    """Number of its episodes in the run, of all methods."""
    seconds: tuple[float, ...]
    """Wall time of each of those that were played, in one worker beside the others [s]."""

    @property
    def whole(self) -> float:
        """Time of all episodes in one worker [s]."""
        return self.episodes * float(np.mean(self.seconds))

    @property
    def variance(self) -> float:
        """Variance of `whole` [s2]; 0 once all episodes were played."""
        n = len(self.seconds)
        return self.episodes * (self.episodes - n) * self._spread**2 / n

    @property
    def fewest(self) -> int:
        """Number of episodes that are played at least."""
        return min(FEWEST, self.episodes)

    @property
    def gain(self) -> float:
        """Variance that one more episode takes away, over its time [s]."""
        n = len(self.seconds)
        if n >= self.episodes:
            return 0.0
        return (self.episodes * self._spread) ** 2 / (n * (n + 1)) / max(float(np.mean(self.seconds)), 1e-9)

    @property
    def _spread(self) -> float:
        return float(np.std(self.seconds, ddof=1)) if len(self.seconds) > 1 else self.seconds[0]


@dataclass(frozen=True, kw_only=True)
class Forecast:
    """Time of a run."""

    shares: Mapping[str, Share]
    """By suite."""
    start: float
    """Wall time until the first worker plays [s]."""

    @property
    def whole(self) -> float:
        """Time of all episodes in one worker [s]."""
        return sum(share.whole for share in self.shares.values())

    @property
    def half_width(self) -> float:
        """Half of the 95 % interval of `whole` [s], by Student's t."""
        from scipy.stats import t

        played = sum(len(share.seconds) for share in self.shares.values())
        quantile = float(t.ppf((1 + CONFIDENCE) / 2, max(played - len(self.shares), 1)))
        return quantile * math.sqrt(sum(share.variance for share in self.shares.values()))

    def time(self, workers: int) -> float:
        """Wall time of the run with so many workers like those that played [s].

        No episode is played by two, and the last ones end at different times, which takes half an episode.
        """
        episodes = sum(share.episodes for share in self.shares.values())
        mean, used = self.whole / episodes, min(workers, episodes)
        return self.start + self.whole / used + (mean / 2 if used > 1 else 0.0)


def forecast(plan: Plan, crew: Crew, workers: int, *, limit: float) -> Forecast:
    """Return how long a plan takes, from playing some of its episodes.

    Args:
        plan: the run; of one that goes on until intervals are narrow, the first batch.
        crew: that plays, as new.
        workers: number of its workers.
        limit: time after which no more episodes are begun [s]; of each suite one at least is played.

    Raises:
        EpisodeError: an episode that cannot be played.
    """
    strata = _strata(plan)
    samples = {name: _sample(plan, suites) for name, suites in strata.items()}
    seconds: dict[str, list[float]] = {name: [] for name in strata}
    begin, starts = time.monotonic(), list[float]()

    def sink(line: Line) -> None:
        if isinstance(line, ErrorLine):
            raise EpisodeError(line.error)
        took = (line.timing[EPISODE] or 0.0) / 1e3
        starts.append(time.monotonic() - begin - took)
        seconds[base_name(line.suite)].append(took)

    def play(names: Sequence[str]) -> None:
        tasks = [task for name in names if (task := next(samples[name], None)) is not None]
        crew.play(tasks, sink, lambda _: None)

    batch = max(workers, 1)
    first = next(iter(plan.tasks()))
    crew.play([first] * batch, sink, lambda _: None)  # they pay for what each worker does once
    for values in seconds.values():
        values.clear()
    play([*samples])
    while True:
        shares = {
            name: Share(episodes=sum(map(plan.count_of, suites)), seconds=tuple(seconds[name]))
            for name, suites in strata.items()
        }
        found = Forecast(shares=shares, start=max(starts[0], 0.0))
        if time.monotonic() - begin > limit:
            return found
        todo = [name for name, share in shares.items() for _ in range(len(share.seconds), share.fewest)]
        if not todo and found.half_width > PRECISE * found.whole:
            todo = [max(shares, key=lambda name: shares[name].gain)] * batch
        if not todo:
            return found
        play(todo)


def _strata(plan: Plan) -> dict[str, list[Suite]]:
    """Suites with episodes by name, the points of a sweep together."""
    strata: dict[str, list[Suite]] = defaultdict(list)
    for suite in plan.suites:
        if plan.count_of(suite):
            strata[base_name(suite.name)].append(suite)
    return strata


def _sample(plan: Plan, suites: Sequence[Suite]) -> Iterator[Task]:
    """Each episode of some suites once, in random order, always the same."""
    rng, left = np.random.default_rng(0), sum(map(plan.count_of, suites))
    taken: set[Task] = set()
    while left > len(taken):
        suite = suites[int(rng.integers(len(suites)))]
        episode, method = (
            int(rng.integers(plan.batch(suite))),
            plan.methods[int(rng.integers(len(plan.methods)))],
        )
        task = Task(suite.name, episode, *method)
        if plan.has(suite, episode) and task not in taken:
            taken.add(task)
            yield task
