"""Output of a run on the terminal: progress while it lasts, and the table of its results in the end."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from types import TracebackType

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from mpgrasp.bench.analysis.summary import CellSummary, ClearingCounts, PairedTest
from mpgrasp.bench.record import ErrorLine, Line, played
from mpgrasp.bench.report.document import Table as ReportTable
from mpgrasp.bench.report.intervals import stops_text
from mpgrasp.names import printable
from mpgrasp.statistics import SIGNIFICANCE

PIPED_WIDTH = 160
"""Columns of a table that goes into a file or a pipe."""


def result_table(cells: Sequence[CellSummary]) -> Table:
    """The table of a run from rows of `summary.summarise`."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 0), collapse_padding=True, header_style="bold")
    for heading in ("suite", "detector", "controller"):
        table.add_column(heading, overflow="fold", vertical="top")
    errors = any(cell.errors for cell in cells)
    headings = (
        "n",
        "success",
        "rate\n%",
        "95 %\ninterval",
        "median\ntime s",
        "mean time s\n(95 %)",
        "stops\n(singular)",
    )
    for heading in (*headings, *(["errors"] if errors else [])):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("failures")
    clearing = any(cell.clearing for cell in cells)
    if clearing:
        for heading in ("picks", "knocked\noff", "left"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("failed picks")
    for cell in cells:
        table.add_row(
            escape(cell.suite),
            escape(cell.detector),
            escape(cell.controller),
            str(cell.n),
            str(cell.successes),
            _number(cell.rate and 100 * cell.rate),
            f"{100 * cell.wilson_low:.1f}-{100 * cell.wilson_high:.1f}",
            _number(cell.median_time_s),
            _with_interval(cell.mean_time_s, cell.mean_time_low, cell.mean_time_high),
            stops_text(cell),
            *([str(cell.errors)] if errors else []),
            _causes(cell.failures),
            *(_clearing(cell.clearing) if clearing else []),
        )
    return table


def _causes(counts: Mapping[str, int]) -> str:
    # no blank within a cause, so that it is never torn apart
    return " ".join(f"{outcome}:{count}" for outcome, count in counts.items()) or "none"


def _clearing(row: ClearingCounts | None) -> list[str]:
    if row is None:
        return ["-"] * 4
    return [str(row.attempts), str(row.knocked_off), str(row.left), _causes(row.failed_attempts)]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _with_interval(value: float | None, low: float | None, high: float | None) -> str:
    bounds = "" if low is None else f" ({low:.1f}-{high:.1f})"
    return _number(value) + bounds


def print_table(cells: Sequence[CellSummary], console: Console | None = None) -> None:
    """Print the table of a run, wide enough for pipes and files too."""
    wide_console(console).print(result_table(cells) if cells else "No episode was finished.")


def print_tests(tests: Sequence[PairedTest], console: Console | None = None) -> None:
    """Print the paired tests of `summary.paired_tests` under the table, if there are any."""
    if not tests:
        return
    table = Table(box=SIMPLE_HEAD, padding=(0, 0), collapse_padding=True, header_style="bold")
    for heading in ("suite", "A", "B"):
        table.add_column(heading, overflow="fold")
    for heading in ("n", "A alone", "B alone", "McNemar p", "Holm p"):
        table.add_column(heading, justify="right", no_wrap=True)
    for test in tests:
        table.add_row(
            escape(test.suite),
            escape(" ".join(test.a)),
            escape(" ".join(test.b)),
            str(test.n),
            str(test.a_alone),
            str(test.b_alone),
            f"{test.p:.3g}",
            f"{test.p_holm:.3g}" + (" *" if test.p_holm < SIGNIFICANCE else ""),
        )
    wide_console(console).print(table)


def print_report_table(content: ReportTable, console: Console | None = None) -> None:
    """Print a table of a report, with its note."""
    table = Table(
        *map(escape, content.headings), box=SIMPLE_HEAD, padding=(0, 0), collapse_padding=True,
        header_style="bold", title=escape(content.caption), title_justify="left",
    )  # fmt: skip
    for row in content.rows:
        table.add_row(*map(escape, row))
    console = wide_console(console)
    console.print(table)
    console.print(escape(content.note), highlight=False)


def wide_console(console: Console | None = None) -> Console:
    """A console (standard output if not given) that does not fold tables in pipes and files."""
    console = console or Console()
    return console if console.is_terminal else Console(file=console.file, width=PIPED_WIDTH)


class RunProgress:
    """A progress bar on a terminal, one line per episode elsewhere, nothing if quiet.

    Args:
        quiet: show nothing but notes.
        console: where to; standard error if not given.
    """

    def __init__(self, *, quiet: bool = False, console: Console | None = None) -> None:
        self._quiet = quiet
        self._console = console or Console(stderr=True)
        self._total = self._before = self._done = self._successes = 0
        self._start = time.monotonic()
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
            self._task = self._bar.add_task("grasping", total=None, successes=0)

    def __enter__(self) -> RunProgress:
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

    def start(self, finished: Iterable[Line]) -> None:
        """These episodes were finished in an earlier part of the run; the clock starts now."""
        before = self._successes = 0
        for line in played(finished):
            before, self._successes = before + 1, self._successes + line.success
        self._before = self._done = before
        self._start = time.monotonic()
        if self._bar:
            self._bar.reset(self._task, completed=self._done, successes=self._successes)
        elif before and not self._quiet:
            self.note(f"{before} episodes are there already")

    def expect(self, total: int) -> None:
        """There will be so many episodes in all."""
        self._total = total
        if self._bar:
            self._bar.update(self._task, total=total)

    def note(self, text: str) -> None:
        """Say something out of the ordinary, even if quiet."""
        self._console.out(f"mpgrasp: {printable(' '.join(text.split()))}", highlight=False)

    def add(self, line: Line) -> None:
        """One more episode is finished."""
        self._done += 1
        self._successes += bool(line.success)
        if self._bar:
            cell = escape(f"{line.suite} {line.detector} {line.controller}")
            self._bar.update(self._task, description=cell, completed=self._done, successes=self._successes)
        if isinstance(line, ErrorLine):
            self.note(f"error: {line.error}")
        elif not self._bar and not self._quiet:
            text = (
                f"[{self._done}/{self._total}, {self._time_left()}] {line.suite} "
                f"episode {line.episode}, {line.detector}, {line.controller}, {line.object}: "
                f"{line.outcome} in {line.sim_time_s:.1f} s"
            )
            self._console.out(printable(text), highlight=False)

    def _time_left(self) -> str:
        pace = (time.monotonic() - self._start) / (self._done - self._before)
        left = round(pace * (self._total - self._done))
        return f"{left // 60}:{left % 60:02d} left"
