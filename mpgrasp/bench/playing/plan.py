"""Plan of a run: suites, methods (detector and controller) and how many episodes of each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from mpgrasp.bench.analysis.ladder import LadderCard
from mpgrasp.bench.analysis.race import RaceCard
from mpgrasp.bench.analysis.sweep import Sweep
from mpgrasp.bench.playing.roster import Roster
from mpgrasp.bench.record import Method, Task
from mpgrasp.camera.backends import BACKENDS
from mpgrasp.command_line import LARGEST, MOST_EPISODES, MOST_UNTIL_CI
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.exceptions import ConfigError
from mpgrasp.settings.sharing import MethodSettings
from mpgrasp.suite import Suite

if TYPE_CHECKING:
    from mpgrasp.bench.meshes.check import MeshVerdict


def every_method(detectors: Sequence[str], controllers: Sequence[str]) -> tuple[Method, ...]:
    """Every detector with every controller.

    Raises:
        ConfigError: a list that is empty or names something twice or not at all.
    """
    for kind, names in (("detector", detectors), ("controller", controllers)):
        if not names or not all(names) or len(set(names)) < len(names):
            raise ConfigError(f"unusable list of {kind}s", got=",".join(names), allowed=f"different {kind}s")
    return tuple(Method(detector, controller) for detector in detectors for controller in controllers)


class Shard(NamedTuple):
    """Every `of`-th episode of a run, with all of its methods, so that pairs of them stay together."""

    number: int
    """1 to `of`."""
    of: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Return the shard that a text such as 3/16 means; `str` makes the text of it.

        Raises:
            ConfigError: another text.
        """
        found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            raise ConfigError("unusable shard", got=text, allowed="K/N with K from 1 to N, such as 3/16")
        return cls(int(found[1]), int(found[2]))

    def has(self, episode: int) -> bool:
        """True if an episode is one of the shard."""
        return episode % self.of == self.number - 1

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """All that decides what a run does."""

    suites: tuple[Suite, ...]
    """Played one after the other, by the same methods."""
    programme: str | None = None
    """Name of what the suites are played for: of a programme, or of the suite that is swept."""
    methods: tuple[Method, ...] = (Method("dhrnet", "mppc"),)
    """In the order of their turns."""
    weights: Mapping[str, Path] = field(default_factory=dict)
    """Weights files by detector; the others take what ships with mpgrasp."""
    settings: Mapping[str, MethodSettings] = field(default_factory=dict)
    """Settings of what plays, by suite; in the others everybody has its own."""
    sweep: Sweep | None = None
    """Grid whose points are the suites; None for a run that is no sweep."""
    ladder: LadderCard | None = None
    """Ladder whose rungs the suites are; its results decide which episodes are played."""
    race: RaceCard | None = None
    """Two methods that play until one is known to be better."""
    runtime: str = "auto"
    """Engine that computes the networks: auto, torch or openvino."""
    objects: tuple[MeshVerdict, ...] = ()
    """The verdict on every mesh that was to take the place of the suite's objects."""
    episodes: int | None = None
    """Episodes of each cell in each suite, with `until_ci` the size of a batch; None: as a suite declares.
    On a ladder, those of each method on all rungs together."""
    until_ci: float | None = None
    """Batches are added until the 95 % interval of every cell is narrower than this [percentage points]."""
    max_episodes: int = MOST_UNTIL_CI
    """With `until_ci`: no cell gets more episodes than this."""
    seed: int = 0
    camera: str = "auto"
    """Camera backend: auto, gl (rasterised) or ray (ray-cast, needs no OpenGL)."""
    noise: bool = True
    """True if the depth camera is as noisy as a real one."""
    shard: Shard | None = None
    """Part of the episodes that is played here; None for all."""
    record: int = 0
    """Number of episodes of each cell that are recorded, the first ones."""
    recordings: Path | None = None
    """Folder of the recordings."""
    traces: Path | None = None
    """Folder of what the report is drawn from; None keeps nothing."""

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("episodes", self.episodes, 1, MOST_EPISODES), ("seed", self.seed, 0, LARGEST),
            ("record", self.record, 0, MOST_EPISODES),
        ):  # fmt: skip
            if value is not None and not least <= value <= most:
                raise ConfigError(f"{name} out of range", got=value, allowed=f"{least} to {most}")
        if self.until_ci is not None and not 0 < self.until_ci < 100:
            raise ConfigError(
                "until-ci out of range", got=self.until_ci, allowed="percentage points between 0 and 100"
            )
        batch = max(self.batch(suite) for suite in self.suites)
        if self.until_ci is not None and self.max_episodes < batch:
            raise ConfigError("max-episodes out of range", got=self.max_episodes, allowed=f"{batch} or more")
        if self.shard is not None:
            self._check_shard(self.shard, batch)
        for name, choice, allowed in (
            ("camera backend", self.camera, BACKENDS), ("runtime", self.runtime, RUNTIMES),
        ):  # fmt: skip
            if choice not in allowed:
                raise ConfigError(f"unknown {name}", got=choice, allowed=allowed)
        for name in self.weights:
            if name not in self.detectors:
                raise ConfigError(
                    "weights for a detector that does not run", got=name, allowed=self.detectors
                )

    def _check_shard(self, shard: Shard, most: int) -> None:
        if self.until_ci is not None:
            raise ConfigError(
                "--until-ci with --shard: a shard cannot know the others' results",
                got=str(shard),
                allowed="one of both",
            )
        if shard.number > most:
            raise ConfigError("a shard without an episode", got=str(shard), allowed=f"K up to {most}")

    @property
    def detectors(self) -> tuple[str, ...]:
        """Names of all detectors that play."""
        return tuple(dict.fromkeys(method.detector for method in self.methods))

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of all controllers that play."""
        return tuple(dict.fromkeys(method.controller for method in self.methods))

    def suite(self, name: str) -> Suite:
        """The suite of that name, which must be one of the plan's."""
        return next(suite for suite in self.suites if suite.name == name)

    def settings_of(self, suite: str) -> MethodSettings:
        """Settings of what plays in a suite."""
        return self.settings.get(suite, MethodSettings())

    def batch(self, suite: Suite) -> int:
        """Episodes of each cell in a suite; with `until_ci` those that are added at a time."""
        if self.ladder is not None:
            return self.ladder.episodes
        return suite.trials if self.episodes is None else self.episodes

    def has(self, suite: Suite, episode: int) -> bool:
        """True if an episode is played in a suite, and here."""
        most = self.batch(suite) if self.until_ci is None else self.max_episodes
        return 0 <= episode < most and (self.shard is None or self.shard.has(episode))

    def roster(self) -> Roster:
        """Order of the episodes; with `until_ci`, of a batch of each suite."""
        suites = {suite.name: self.batch(suite) for suite in self.suites}
        return Roster(suites=suites, methods=self.methods)

    def count(self) -> int:
        """Number of `tasks`."""
        if self.ladder is not None:
            return self.ladder.episodes * len(self.methods)
        return sum(map(self.count_of, self.suites))

    def count_of(self, suite: Suite) -> int:
        """Number of tasks of a batch of a suite."""
        episodes = range(self.batch(suite))
        if self.shard is not None:
            episodes = episodes[self.shard.number - 1 :: self.shard.of]
        return len(episodes) * len(self.methods)

    def tasks(self) -> Iterator[Task]:
        """A batch of every suite, in order."""
        return (task for suite in self.suites for task in self.tasks_of(suite, 0, self.batch(suite)))

    def tasks_of(self, suite: Suite, start: int, stop: int) -> Iterator[Task]:
        """Every episode of a suite from `start` to before `stop`, of every method, in order.

        Episode by episode, every method plays in turn, so that a run that is stopped half-way still
        compares its methods over the same episodes.
        """
        return (
            Task(suite.name, episode, *method)
            for episode in range(start, stop)
            if self.has(suite, episode)
            for method in self.methods
        )
