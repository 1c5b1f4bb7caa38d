"""What a run is asked to do: the suite, the cells (detector, controller) and how many episodes of each."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from mpgrasp.bench.suite import Suite
from mpgrasp.detectors import RUNTIMES
from mpgrasp.exceptions import ConfigError

CAMERA_BACKENDS = ("auto", "gl", "ray")


class EpisodeKey(NamedTuple):
    """What tells one line of a run from all others."""

    suite: str
    episode: int
    detector: str
    controller: str


@dataclass(frozen=True, kw_only=True)
class Task:
    """One episode of one cell."""

    episode: int
    detector: str
    controller: str

    @property
    def stem(self) -> str:
        """File name, without ending, of what is recorded of this episode."""
        name = f"{self.detector}-{self.controller}-{self.episode:04d}"
        return re.sub(r"[^A-Za-z0-9._-]+", "-", name)

    def __str__(self) -> str:
        return f"episode {self.episode} ({self.detector}, {self.controller})"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """All that decides what a run does."""

    suite: Suite
    detectors: tuple[str, ...] = ("dhrnet",)
    """Registry names or import paths."""
    controllers: tuple[str, ...] = ("mppc",)
    """Registry names or import paths."""
    weights: Mapping[str, Path] = field(default_factory=dict)
    """Weights files by detector; the others take what ships with mpgrasp."""
    runtime: str = "auto"
    """What computes the networks: auto, torch or openvino."""
    episodes: int = 10
    """Episodes of each cell; with `until_ci` the size of a batch."""
    until_ci: float | None = None
    """Batches are added until the 95 % interval of every cell is narrower than this [percentage points]."""
    max_episodes: int = 1000
    """With `until_ci`: no cell gets more episodes than this."""
    seed: int = 0
    camera: str = "auto"
    """Camera backend: auto, gl (rasterised) or ray (ray-cast, needs no OpenGL)."""
    noise: bool = True
    """Whether the depth camera is as noisy as a real one."""
    record: int = 0
    """Number of episodes of each cell that are recorded, the first ones."""
    recordings: Path | None = None
    """Folder of the recordings."""

    def __post_init__(self) -> None:
        for name, value, least in (
            ("episodes", self.episodes, 1), ("seed", self.seed, 0), ("record", self.record, 0),
        ):  # fmt: skip
            if value < least:
                raise ConfigError(f"{name} out of range", got=value, allowed=f"{least} or more")
        if self.until_ci is not None and not 0 < self.until_ci < 100:
            raise ConfigError(
                "until-ci out of range", got=self.until_ci, allowed="percentage points between 0 and 100"
            )
        if self.until_ci is not None and self.max_episodes < self.episodes:
            raise ConfigError(
                "max-episodes out of range", got=self.max_episodes, allowed=f"{self.episodes} or more"
            )
        for name, choice, allowed in (
            ("camera backend", self.camera, CAMERA_BACKENDS), ("runtime", self.runtime, RUNTIMES),
        ):  # fmt: skip
            if choice not in allowed:
                raise ConfigError(f"unknown {name}", got=choice, allowed=allowed)
        for kind, names in (("detector", self.detectors), ("controller", self.controllers)):
            if not names or not all(names) or len(set(names)) < len(names):
                raise ConfigError(
                    f"unusable list of {kind}s", got=",".join(names), allowed=f"different {kind}s"
                )
        for name in self.weights:
            if name not in self.detectors:
                raise ConfigError(
                    "weights for a detector that does not run", got=name, allowed=self.detectors
                )

    def tasks(self, start: int = 0, stop: int | None = None) -> list[Task]:
        """Every episode from `start` to before `stop` (`episodes` if not given) of every cell, in order.

        Episode by episode, every cell plays in turn, so that a run that is stopped half-way still
        compares its cells over the same episodes.
        """
        return [
            Task(episode=episode, detector=detector, controller=controller)
            for episode in range(start, self.episodes if stop is None else stop)
            for detector in self.detectors
            for controller in self.controllers
        ]

    def key(self, task: Task) -> EpisodeKey:
        """Key of the task's line."""
        return EpisodeKey(self.suite.name, task.episode, task.detector, task.controller)
