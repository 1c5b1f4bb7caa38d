"""Episodes of the study of factors: what the factors are, how an episode is played, and where it is kept."""

from __future__ import annotations

import csv
import io
import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

from factorial import LETTERS, design
from study import not_negative, track

from mpgrasp.controllers.config import ALPHA, MVP, ReachConfig
from mpgrasp.controllers.grid_map import EXTENT_PUBLISHED
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.plugins import load_detector
from mpgrasp.suite import Suite, episode_seed, load_suite

LENGTH, WIDTH = 0.060, 0.018  # of the stick [m]


@dataclass(frozen=True, kw_only=True)
class Factor:
    """One difference between controllers; its low level is what `mvp` has."""

    name: str
    controller: Mapping[str, Any] = field(default_factory=dict)
    """Settings of `ReachConfig` at the high level."""
    grid: Mapping[str, Any] = field(default_factory=dict)
    """Settings of `GridConfig` at the high level."""


FACTORS = (
    Factor(name="prior out of the mean", grid={"prior_in_mean": False}),
    Factor(name="rank by evidence", grid={"evidence": 20.0}),
    Factor(name="border open", controller={"border": "nothing"}, grid={"border_counts": True}),
    Factor(name="gamma 8", controller={"gamma": 8.0}),
    Factor(name="descent coupled", controller={"descent": "coupled"}),
    Factor(name="grid 0.34 m", grid={"extent": EXTENT_PUBLISHED}),
    Factor(name="alpha 0.2", controller={"alpha": ALPHA}),
    Factor(name="grasp of one view", controller={"choice": "pool"}),
)
"""In the order of the design's letters."""
NAMES = {letter: f"{letter} {factor.name}" for letter, factor in zip(LETTERS, FACTORS, strict=True)}


class Task(NamedTuple):
    """One episode of the study."""

    thickness_mm: float
    world: int
    run: int


Rows = dict[Task, dict[str, str]]
"""Finished episodes, as texts by column."""
COLUMNS = (
    *Task._fields, *LETTERS, "scene_seed", "outcome", "success", "stop", "blind_drift_m",
    "min_singular_value", "near_singularity_s", "first_detection_s", "sim_time_s", "reflex",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Study:
    """Settings that decide an episode; those of a folder stay the same."""

    detector: str = "dhrnet"
    seed: int = 0
    camera: str = "auto"

    def __post_init__(self) -> None:
        not_negative("seed", self.seed)


def config_of(run: int) -> ReachConfig:
    """Settings of the controller that plays a run of the design."""
    high = [factor for factor, level in zip(FACTORS, design()[run], strict=True) if level > 0]
    changes: dict[str, Any] = {}
    grid: dict[str, Any] = {}
    for factor in high:
        changes |= factor.controller
        grid |= factor.grid
    return replace(MVP, grid=replace(MVP.grid, **grid), **changes)


@cache
def suite_of(thickness_mm: float) -> Suite:
    """The suite `thin_2mm` with a stick of another thickness, and with worlds of its own."""
    stick = {"name": f"stick_{thickness_mm:g}mm", "box": [LENGTH, WIDTH, thickness_mm / 1000]}
    suite = load_suite("thin_2mm").with_settings({"scene": {"objects": [stick]}}, "controller_factors, [{}]")
    return replace(suite, name=f"controller_factors_{thickness_mm:g}mm")


@cache
def detector_of(name: str) -> GraspDetector:
    """A detector, made once for each process."""
    return load_detector(name)


def play(study: Study, task: Task) -> dict[str, Any]:
    """Play one episode and return its row."""
    from mpgrasp import make_controller, run_episode

    suite = suite_of(task.thickness_mm)
    seed = episode_seed(suite.name, study.seed, task.world)
    result = run_episode(
        suite.scene_config(task.world),
        seed,
        detector=detector_of(study.detector),
        controller=make_controller("mvp", config_of(task.run)),
        config=suite.episode_config(camera=study.camera),
    )
    levels = dict(zip(LETTERS, design()[task.run].astype(int).tolist(), strict=True))
    record = result.as_record() | {
        "stop": int(result.reflex is not None),
        "success": int(result.success),
        "reflex": "" if result.reflex is None else str(result.reflex),
        "scene_seed": seed,
    }
    return {key: record[key] for key in COLUMNS if key in record} | task._asdict() | levels


def play_all(study: Study, tasks: Sequence[Task], workers: int, file: Path) -> Rows:
    """Play what `file` does not hold yet, keep each episode there as soon as it is finished, and return all.

    Raises:
        OutputError: the file cannot be read or written.
    """
    rows = _kept(file)
    missing = [task for task in tasks if task not in rows]
    try:
        with file.open("a", encoding="utf-8", newline="") as stream:
            for row in track(_played(study, missing, workers), "episodes", len(missing)):
                stream.write(_line(row))
                stream.flush()
    except OSError as error:
        raise OutputError(f"episodes cannot be kept: {error}", got=str(file)) from error
    return _kept(file)


def _played(study: Study, tasks: Sequence[Task], workers: int) -> Iterator[dict[str, Any]]:
    if workers == 1:
        yield from map(partial(play, study), tasks)
        return
    # spawned: a process that was forked after OpenVINO or OpenGL have started hangs
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(partial(play, study), tasks)


def _kept(file: Path) -> Rows:
    """Finished episodes of a file; it is begun if there is none, and a last line that is not whole goes."""
    try:
        text = file.read_text("utf-8") if file.is_file() else ""
        whole = text[: text.rfind("\n") + 1] or _line(dict(zip(COLUMNS, COLUMNS, strict=True)))
        if whole != text:
            replace_file(file, whole)
        found = csv.DictReader(io.StringIO(whole))
        return {Task(float(row["thickness_mm"]), int(row["world"]), int(row["run"])): row for row in found}
    except (OSError, KeyError, ValueError) as error:
        raise OutputError(f"episodes cannot be read: {error!r}", got=str(file)) from error


def _line(row: Mapping[str, Any]) -> str:
    text = io.StringIO()
    csv.DictWriter(text, COLUMNS, lineterminator="\n").writerow(row)
    return text.getvalue()
