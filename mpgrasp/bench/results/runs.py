"""Reads finished runs for a report: one folder, or a folder of folders, as one set of cells."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpgrasp.bench.record import Cells, Task, by_cell
from mpgrasp.bench.results.reader import RUN, read_run
from mpgrasp.bench.results.trace import Trace, read_trace
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.exceptions import ConfigError

Cell = tuple[str, str, str]
"""(suite, detector, controller)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One folder of results."""

    folder: Path
    about: Mapping[str, Any]
    """Content of run.json."""
    lines: Sequence[Mapping[str, Any]]
    """Of episodes.jsonl, one per episode."""
    complete: bool | None
    """What summary.json says; None where there is none."""

    @property
    def configuration(self) -> Mapping[str, Any]:
        """What decided the results."""
        found = self.about.get("configuration")
        return found if isinstance(found, Mapping) else {}

    def trace(self, line: Mapping[str, Any]) -> Trace | None:
        """What was kept of an episode; None if nothing was.

        Raises:
            OutputError: a file that is no trace.
        """
        which = {key: line[key] for key in ("suite", "episode", "detector", "controller")}
        task = Task(**which)
        return read_trace(self.folder / "traces", task.stem, line)

    def reads_truth(self, detector: str) -> bool:
        """Whether a detector is shown the truth and needs no network."""
        known = self.configuration.get("detectors") or ()
        return any(item.get("name") == detector and item.get("reads_truth") for item in known)

    def map_extent(self, controller: str) -> tuple[float, float, float, float] | None:
        """Bounds in x, then in y [m] of a controller's entropy map; None where it is not known."""
        try:
            (config,) = [c["config"] for c in self.configuration["controllers"] if c["name"] == controller]
            (x, y), half = config["grid"]["centre"], config["grid"]["extent"] / 2
        except (KeyError, TypeError, ValueError):
            return None
        return x - half, x + half, y - half, y + half


@dataclass(frozen=True, kw_only=True, eq=False)
class Runs:
    """What a report is about."""

    runs: Sequence[Run]
    cells: Cells
    """Lines by cell."""
    owners: Mapping[Cell, Run]
    """Which run played a cell."""

    @property
    def lines(self) -> list[Mapping[str, Any]]:
        """Every line of every run."""
        return [line for run in self.runs for line in run.lines]

    @property
    def suites(self) -> list[str]:
        """Names of the suites, in order of first appearance."""
        return list(dict.fromkeys(suite for suite, _, _ in self.cells))


def find_runs(folders: Sequence[Path]) -> Runs:
    """The runs in these folders, each a run's or one whose folders are runs'.

    Raises:
        OutputError: no run there, or one that cannot be read.
        ConfigError: a cell that occurs in two of them.
    """
    found = [path for folder in folders for path in _run_folders(folder)]
    runs = [_read(path) for path in dict.fromkeys(found)]
    cells: Cells = {}
    owners: dict[Cell, Run] = {}
    for run in runs:
        for cell, lines in by_cell(run.lines).items():
            if cell in cells:
                raise ConfigError(
                    f"two runs have played {'/'.join(cell)}",
                    got=[str(owners[cell].folder), str(run.folder)],
                    allowed="each cell once in a report",
                )
            cells[cell], owners[cell] = lines, run
    return Runs(runs=runs, cells=cells, owners=owners)


def _run_folders(folder: Path) -> list[Path]:
    if (folder / RUN).is_file():
        return [folder]
    inside = sorted(
        path.parent for path in folder.glob(f"*/{RUN}") if (path.parent / "episodes.jsonl").exists()
    )
    return inside or [folder]


def _read(folder: Path) -> Run:
    about = read_run(folder)
    complete: bool | None
    try:
        complete = bool(json.loads((folder / "summary.json").read_text(encoding="utf-8"))["complete"])
    except (OSError, ValueError, KeyError, TypeError):
        complete = None
    return Run(folder=folder, about=about, lines=RunDirectory(folder).episodes(), complete=complete)
