"""Traces that the runs of a report have kept, and the commands that make those that are missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mpgrasp.bench.record import Cell, PlayedLine, played
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.shell_commands import replay_command
from mpgrasp.bench.results.runs import Runs
from mpgrasp.bench.results.trace import Trace
from mpgrasp.exceptions import MpgraspError

Traced = tuple[PlayedLine, Trace]
"""An episode with its trace."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KeptTraces:
    """Every trace that was kept."""

    by_cell: Mapping[Cell, Sequence[Traced]]
    """In the order of the episodes; empty where a cell has none."""
    unreadable: Sequence[str]
    """Troubles with traces that cannot be read."""

    def examples(self, cell: Cell) -> list[tuple[str, Traced]]:
        """The first success and the first failure of a cell that have a trace, each after its name."""
        found = []
        for word, success in (("success", True), ("failure", False)):
            found += [(word, traced) for traced in self.by_cell[cell] if traced[0].success is success][:1]
        return found


NO_TRACES = KeptTraces(by_cell={}, unreadable=())
"""Traces of a report that draws none."""


@dataclass(frozen=True, kw_only=True)
class MissingTraces:
    """Cells of which no trace was kept."""

    cells: Sequence[str]
    """Their names in words."""
    commands: Sequence[str]
    """One for each: plays its first episode again and records it."""


def read_traces(runs: Runs) -> KeptTraces:
    """Read every trace that was kept."""
    by_cell: dict[Cell, list[Traced]] = {}
    unreadable: list[str] = []
    for cell, lines in runs.cells.items():
        kept = []
        for line in played(lines):
            try:
                trace = runs.owners[cell].trace(line)
            except MpgraspError as error:
                unreadable.append(str(error))
                continue
            if trace is not None:
                kept.append((line, trace))
        by_cell[cell] = sorted(kept, key=lambda traced: traced[0].episode)
    return KeptTraces(by_cell=by_cell, unreadable=unreadable)


def missing_traces(runs: Runs, cells: Sequence[Cell], kept: KeptTraces) -> MissingTraces | None:
    """Those of some cells that were played and of which no trace was kept; None where there are none."""
    first = {
        cell: min(played(runs.cells[cell]), key=lambda line: line.episode, default=None)
        for cell in cells
        if not kept.by_cell[cell]
    }
    lost = {cell: line for cell, line in first.items() if line is not None}
    if not lost:
        return None
    return MissingTraces(
        cells=[name_of(cell.method) for cell in lost],
        commands=[replay_command(runs.owners[cell].folder, line.task) for cell, line in lost.items()],
    )
