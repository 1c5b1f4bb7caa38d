"""What the user sees of a run: progress while it lasts, and the table in the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

PIPED_WIDTH = 160
"""Columns of a table that goes into a file or a pipe."""


def result_table(cells: Sequence[Mapping[str, Any]]) -> Table:
    """The table of a run from rows of `statistics.summarise`."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 0), collapse_padding=True, header_style="bold")
    for heading in ("suite", "detector", "controller"):
        table.add_column(heading, overflow="fold", vertical="top")
    for heading in ("n", "success", "rate\n%", "95 %\ninterval", "median\ntime s", "reflex\nstops"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("failures")
    for cell in cells:
        table.add_row(
            cell["suite"],
            cell["detector"],
            cell["controller"],
            str(cell["n"]),
            str(cell["successes"]),
            f"{100 * cell['rate']:.1f}",
            f"{100 * cell['wilson_low']:.1f}-{100 * cell['wilson_high']:.1f}",
            f"{cell['median_time_s']:.1f}",
            str(cell["reflex_stops"]),
            # no blank within a cause, so that it is never torn apart
            " ".join(f"{outcome}:{count}" for outcome, count in cell["failures"].items()) or "none",
        )
    return table


def print_table(cells: Sequence[Mapping[str, Any]], console: Console | None = None) -> None:
    """Print the table of a run, wide enough for pipes and files too."""
    console = console or Console()
    if not console.is_terminal:
        console = Console(file=console.file, width=PIPED_WIDTH)
    console.print(result_table(cells) if cells else "No episode was finished.")


class ProgressReport:
    """A progress bar on a terminal, one line per episode elsewhere, nothing if quiet.

    Args:
        total: number of episodes.
        quiet: show nothing.
        console: where to; standard error if not given.
    """

    def __init__(self, total: int, *, quiet: bool = False, console: Console | None = None) -> None:
        self._total = total
        self._quiet = quiet
        self._console = console or Console(stderr=True)
        self._done = self._successes = 0
        self._bar: Progress | None = None
        if self._console.is_terminal and not quiet:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[successes]} successes"),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                console=self._console,
            )
            self._task = self._bar.add_task("grasping", total=total, successes=0)

    def __enter__(self) -> ProgressReport:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._bar:
            self._bar.stop()

    def add(self, line: Mapping[str, Any]) -> None:
        """One more episode is finished."""
        self._done += 1
        self._successes += bool(line["success"])
        if self._bar:
            cell = f"{line['suite']} {line['detector']} {line['controller']}"
            self._bar.update(self._task, description=cell, completed=self._done, successes=self._successes)
        elif not self._quiet:
            text = (
                f"[{self._done}/{self._total}] {line['suite']} episode {line['episode']}, "
                f"{line['detector']}, {line['controller']}, {line['object']}: "
                f"{line['outcome']} in {line['sim_time_s']:.1f} s"
            )
            self._console.out(text, highlight=False)
