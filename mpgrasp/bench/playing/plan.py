"""What a run is asked to do: suites, cells (detector, controller) and how many episodes of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from mpgrasp.bench.record import Cell, Task
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.exceptions import ConfigError
from mpgrasp.suite import Suite

if TYPE_CHECKING:
    from mpgrasp.bench.meshes.check import Verdict

CAMERA_BACKENDS = ("auto", "gl", "ray")


def every_cell(detectors: Sequence[str], controllers: Sequence[str]) -> tuple[Cell, ...]:
    """Every detector with every controller.

    Raises:
        ConfigError: a list that is empty or names something twice or not at all.
    """
    for kind, names in (("detector", detectors), ("controller", controllers)):
        if not names or not all(names) or len(set(names)) < len(names):
            raise ConfigError(f"unusable list of {kind}s", got=",".join(names), allowed=f"different {kind}s")
    return tuple(Cell(detector, controller) for detector in detectors for controller in controllers)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """All that decides what a run does."""

    suites: tuple[Suite, ...]
    """Played one after the other, by the same cells."""
    programme: str | None = None
    """Name of what the suites are played for, where it is more than one suite."""
    cells: tuple[Cell, ...] = (Cell("dhrnet", "mppc"),)
    """In the order of their turns."""
    weights: Mapping[str, Path] = field(default_factory=dict)
    """Weights files by detector; the others take what ships with mpgrasp."""
    runtime: str = "auto"
    """What computes the networks: auto, torch or openvino."""
    objects: tuple[Verdict, ...] = ()
    """What came of every mesh that was to take the place of the suite's objects."""
    episodes: int | None = None
    """Episodes of each cell in each suite, with `until_ci` the size of a batch; None: as a suite declares."""
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
    traces: Path | None = None
    """Folder of what the report is drawn from; None keeps nothing."""

    def __post_init__(self) -> None:
        for name, value, least in (
            ("episodes", self.episodes, 1), ("seed", self.seed, 0), ("record", self.record, 0),
        ):  # fmt: skip
            if value is not None and value < least:
                raise ConfigError(f"{name} out of range", got=value, allowed=f"{least} or more")
        if self.until_ci is not None and not 0 < self.until_ci < 100:
            raise ConfigError(
                "until-ci out of range", got=self.until_ci, allowed="percentage points between 0 and 100"
            )
        batch = max(self.batch(suite) for suite in self.suites)
        if self.until_ci is not None and self.max_episodes < batch:
            raise ConfigError("max-episodes out of range", got=self.max_episodes, allowed=f"{batch} or more")
        for name, choice, allowed in (
            ("camera backend", self.camera, CAMERA_BACKENDS), ("runtime", self.runtime, RUNTIMES),
        ):  # fmt: skip
            if choice not in allowed:
                raise ConfigError(f"unknown {name}", got=choice, allowed=allowed)
        for name in self.weights:
            if name not in self.detectors:
                raise ConfigError(
                    "weights for a detector that does not run", got=name, allowed=self.detectors
                )

    @property
    def detectors(self) -> tuple[str, ...]:
        """Names of all detectors that play."""
        return tuple(dict.fromkeys(cell.detector for cell in self.cells))

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of all controllers that play."""
        return tuple(dict.fromkeys(cell.controller for cell in self.cells))

    def suite(self, name: str) -> Suite:
        """The suite of that name, which must be one of the plan's."""
        return next(suite for suite in self.suites if suite.name == name)

    def batch(self, suite: Suite) -> int:
        """Episodes of each cell in a suite; with `until_ci` those that are added at a time."""
        return suite.trials if self.episodes is None else self.episodes

    def place(self, task: Task) -> tuple[int, ...]:
        """Where a task stands in the order of the plan: of two tasks, the one with the lesser place is first.

        What the plan does not have comes after everything that it has.
        """
        suites, cells = [suite.name for suite in self.suites], self.cells
        cell = Cell(task.detector, task.controller)
        if task.suite not in suites or cell not in cells:
            return (len(suites),)
        return suites.index(task.suite), task.episode, cells.index(cell)

    def tasks(self) -> list[Task]:
        """A batch of every suite, in order."""
        return [task for suite in self.suites for task in self.tasks_of(suite, 0, self.batch(suite))]

    def tasks_of(self, suite: Suite, start: int, stop: int) -> list[Task]:
        """Every episode of a suite from `start` to before `stop`, of every cell, in order.

        Episode by episode, every cell plays in turn, so that a run that is stopped half-way still
        compares its cells over the same episodes.
        """
        return [
            Task(suite=suite.name, episode=episode, detector=cell.detector, controller=cell.controller)
            for episode in range(start, stop)
            for cell in self.cells
        ]
