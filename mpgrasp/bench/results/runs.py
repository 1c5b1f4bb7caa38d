"""Reads finished runs for a report: one folder, or a folder of folders, as one set of cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mpgrasp.bench.record import Cell, Cells, ErrorLine, Line
from mpgrasp.bench.results.reader import EPISODES, RUN, read_complete, read_run
from mpgrasp.bench.results.run_card import Configuration, RunDescription
from mpgrasp.bench.results.trace import Trace, read_trace
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import StoredLines, by_cell
from mpgrasp.exceptions import ConfigError


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One folder of results."""

    folder: Path
    about: RunDescription
    """Content of run.json."""
    lines: StoredLines
    """Lines of episodes.jsonl, one per episode."""
    complete: bool | None
    """True or False as summary.json says; None where there is none."""

    @property
    def configuration(self) -> Configuration:
        """All that decided the results."""
        return self.about.configuration

    def trace(self, line: Line) -> Trace | None:
        """Return what the run or a recorded replay has kept of an episode; None if nothing was kept.

        Raises:
            OutputError: a file that is no trace.
        """
        if isinstance(line, ErrorLine):
            return None
        return read_trace(self.folder / "traces", line) or read_trace(self.folder / "recordings", line)

    def reads_truth(self, detector: str) -> bool:
        """True if a detector is shown the truth and needs no network."""
        known = self.configuration.detectors
        return any(card.name == detector and card.reads_truth for card in known)

    def map_extent(self, cell: Cell) -> tuple[float, float, float, float] | None:
        """Bounds in x, then in y [m] of the entropy map of a cell; None where it is not known."""
        configs = [card.config for card in self.configuration.controllers if card.name == cell.controller]
        if self.configuration.sweep:  # whose points may differ in them
            parts = [part for part in self.configuration.parts if part.suite.name == cell.suite]
            configs = [part.settings.get("controller", {}).get(cell.controller) for part in parts]
        try:
            (config,) = configs
            (x, y), half = config["grid"]["centre"], config["grid"]["extent"] / 2
        except (KeyError, TypeError, ValueError):  # a controller of one's own has the config that it likes
            return None
        return x - half, x + half, y - half, y + half


@dataclass(frozen=True, kw_only=True, eq=False)
class Runs:
    """Runs that are reported together."""

    runs: Sequence[Run]
    cells: Cells
    """Lines by cell."""
    owners: Mapping[Cell, Run]
    """The run that played a cell."""

    @property
    def suites(self) -> list[str]:
        """Names of the suites, in order of first appearance."""
        return list(dict.fromkeys(cell.suite for cell in self.cells))


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
                    f"two runs have played {cell}",
                    got=[str(owners[cell].folder), str(run.folder)],
                    allowed="each cell once in a report",
                )
            cells[cell], owners[cell] = lines, run
    return Runs(runs=runs, cells=cells, owners=owners)


def _run_folders(folder: Path) -> list[Path]:
    if (folder / RUN).is_file():
        return [folder]
    inside = sorted(path.parent for path in folder.glob(f"*/{RUN}") if (path.parent / EPISODES).exists())
    return inside or [folder]


def _read(folder: Path) -> Run:
    return Run(
        folder=folder,
        about=read_run(folder),
        lines=RunDirectory(folder).episodes(),
        complete=read_complete(folder),
    )
