"""Content of run.json: all that decides a run's results, and what they were made with.

Cards of plug-ins and of configurations that grow with the project stay plain values; everything else is
typed, so that a key too many or too few is an error. Keys with a default are left out of the file where they
say nothing. benchmarks/README.md explains the keys to users.
"""

from __future__ import annotations

from typing import Any, Literal

from msgspec import field

from mpgrasp.bench.analysis.ladder import LadderCard
from mpgrasp.bench.analysis.race import RaceCard
from mpgrasp.bench.analysis.sweep import Sweep
from mpgrasp.bench.record import Record
from mpgrasp.bench.results.provenance import MadeWith
from mpgrasp.files.json_values import Difference, difference

Card = dict[str, Any]
"""Settings by name, as plain values."""


class SuiteCard(Record, frozen=True, kw_only=True, omit_defaults=True):
    """A suite: `mpgrasp.suite.Suite` in plain values."""

    name: str
    title: str
    scenes: tuple[Card, ...]
    """Scenes of the turns."""
    trial: str
    trials: int
    episode: Card
    """Settings of the episodes that the suite changes."""
    controller: Card = field(default_factory=dict)
    """Settings that it has for the controllers."""
    detector: Card = field(default_factory=dict)
    """Settings that it has for the detectors."""


class SuitePart(Record, frozen=True, kw_only=True, omit_defaults=True):
    """One suite of a run and how it was played."""

    settings: Card = field(default_factory=dict)
    """Tree of settings as used: values by group; empty in runs from before there was one."""
    suite: SuiteCard
    episode: Card
    """Settings of the episodes."""
    episodes: int
    """Episodes of each cell, with `until_ci` those that are added at a time."""


class DetectorCard(Record, frozen=True, kw_only=True, omit_defaults=True):
    """A detector of a run."""

    name: str
    weights: str | None
    """Name of the weights file that was given; None where none was."""
    sha256: str | None
    """Hash of the weights; None where there are none that mpgrasp knows of."""
    reads_truth: bool
    device: str | None
    runtime: str | None
    config: Any
    source: str | None = None
    """Hash of a plug-in's source; None for a detector of the registry."""


class ControllerCard(Record, frozen=True, kw_only=True, omit_defaults=True):
    """A controller of a run."""

    name: str
    config: Any
    source: str | None = None
    """Hash of a plug-in's source; None for a controller of the registry."""


class Configuration(Record, frozen=True, kw_only=True, omit_defaults=True):
    """All that decides what the lines of a run say.

    A run of one suite has its card, with `settings`, `episode` and `episodes`; a run of a programme has the
    programme's name, with `suites`; a sweep the name of the suite that is swept, with its points as `suites`.
    Cards of detectors and controllers are those of the first suite.
    """

    settings: Card = field(default_factory=dict)
    """Tree of settings as used: values by group. It stands before the suite, so that a difference of two runs
    is named after the setting."""
    suite: SuiteCard | str
    suites: tuple[SuitePart, ...] = ()
    sweep: Sweep | None = None
    """Grid of a sweep, whose points are the suites."""
    ladder: LadderCard | None = None
    """Ladder, whose rungs are the suites; its results decided which episodes were played."""
    race: RaceCard | None = None
    """Two methods that played until one was known to be better."""
    episode: Card | None = None
    episodes: int | None = None
    cells: tuple[str, ...]
    """Methods that played, as DETECTOR/CONTROLLER."""
    detectors: tuple[DetectorCard, ...]
    controllers: tuple[ControllerCard, ...]
    until_ci: float | None
    """Width of the 95 % intervals at which the run ended [percentage points]; None where it did not count."""
    max_episodes: int | None
    seed: int
    camera: str
    """Camera backend that was asked for."""
    noise: bool
    shard: str | None = None
    """Part of the run that was played, as "3/16"; None for all of it."""

    def __post_init__(self) -> None:
        alone = isinstance(self.suite, SuiteCard)
        present = [bool(self.suites), self.episode is not None, self.episodes is not None]
        if present != [not alone, alone, alone]:
            raise ValueError("either one suite with `episode` and `episodes`, or a programme with `suites`")

    def difference(self, other: Configuration) -> Difference | None:
        """Return the first difference of two configurations, who plays before how; None if equal."""
        ours, theirs = ({"cells": row["cells"], **row} for row in (self.as_row(), other.as_row()))
        return difference(ours, theirs)

    @property
    def parts(self) -> tuple[SuitePart, ...]:
        """The suites and how they were played, of a run of one suite or of a programme."""
        if isinstance(self.suite, str):
            return self.suites
        assert self.episode is not None
        assert self.episodes is not None
        return (
            SuitePart(settings=self.settings, suite=self.suite, episode=self.episode, episodes=self.episodes),
        )


class WorldCard(Record, frozen=True, kw_only=True):
    """Physics, camera and arm of a suite's episodes."""

    physics: Card
    """Solver options of the compiled model, and the contacts of every named geom."""
    camera: Card
    motion: Card
    """Limits of the tool's motion."""
    ik: Card
    """Settings of the differential inverse kinematics."""
    reflex: Card
    """Limits whose breach is a protective stop."""


class MeshCard(Record, frozen=True, kw_only=True, omit_defaults=True):
    """A mesh of `--objects`: the reason why it was refused, or the object that it became."""

    name: str
    file: str
    """Name of the file, without its folder."""
    sha256: str | None
    """Hash of the file; None where it cannot be read."""
    reason: str | None = None
    mass: float | None = None
    """[kg]"""
    friction: float | None = None
    """Sliding friction coefficient, where it was told."""
    size: tuple[float, ...] | None = None
    """Edges of the bounding box [m]."""
    pieces: int | None = None
    """Number of convex parts."""
    grasp_qualities: tuple[float | None, ...]
    """Quality of the best grasp in each rest pose [0, 1]; None where the object did not come to rest."""


class Resumption(Record, frozen=True, kw_only=True, omit_defaults=True):
    """A later part of a run that was interrupted."""

    started: str
    made_with: MadeWith | None = None
    """Versions, where they are others than those of the first part."""


class RunDescription(Record, frozen=True, kw_only=True, omit_defaults=True):
    """Content of run.json."""

    format: Literal[1]
    command: str
    started: str
    """Date and time, with the offset from UTC."""
    configuration: Configuration
    """Two runs in one folder must agree in it."""
    physics: Card
    """With `camera`, `motion`, `ik` and `reflex`, the world of the first suite, as in `WorldCard`."""
    camera: Card
    motion: Card
    ik: Card
    reflex: Card
    worlds: dict[str, WorldCard] = field(default_factory=dict)
    """World by suite, where there are several suites; of a sweep, those that differ from the first one's."""
    objects: tuple[MeshCard, ...] = ()
    """Every mesh of `--objects`."""
    made_with: MadeWith
    resumed: tuple[Resumption, ...] = ()
