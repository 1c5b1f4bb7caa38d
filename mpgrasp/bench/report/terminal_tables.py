"""Tables of a run on the terminal: whole in a pipe or a file, and such that a terminal can show them."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from mpgrasp.bench.analysis.summary import CellSummary, ClearingCounts, PairedTest
from mpgrasp.bench.report.document import Table as ReportTable
from mpgrasp.bench.report.intervals import stops_text
from mpgrasp.statistics import SIGNIFICANCE

PIPED_WIDTH = 160
"""Columns of a table that goes into a file or a pipe."""

_ENDLESS = 10_000
_CLEARING = ("picks", "knocked\noff", "left", "failed picks")
_METHOD = ("suite", "detector", "controller")
_MEAN_WITH, _MEAN, _MEDIAN = "mean time s\n(95 %)", "mean\ntime s", "median\ntime s"
_STEPS = ((_MEDIAN,), (_MEAN_WITH,), ("n", "success"), (_MEAN,), ("left", "knocked\noff"), ("failures",))
_NARROWER = tuple(tuple(itertools.chain.from_iterable(_STEPS[:k])) for k in range(len(_STEPS) + 1))
"""Columns that a table leaves out, step by step, until it fits a terminal: report.html has all of them."""


def result_table(cells: Sequence[CellSummary], without: Collection[str] = ()) -> Table:
    """The table of a run from rows of `summary.summarise`.

    Args:
        cells: the rows.
        without: headings of columns that are left out; the suite too where it is the same in all rows.
    """
    rows = [_row(cell) for cell in cells]
    shown = [heading for heading in rows[0] if heading not in without] if rows else []
    if _MEAN_WITH in shown:
        shown.remove(_MEAN)
    if not any(cell.errors for cell in cells):
        shown = [heading for heading in shown if heading != "errors"]
    if not any(cell.clearing for cell in cells):
        shown = [heading for heading in shown if heading not in _CLEARING]
    one = len({cell.suite for cell in cells}) == 1
    if without and one:
        shown.remove("suite")
    title = escape(cells[0].suite) if without and one else None
    table = Table(
        box=SIMPLE_HEAD,
        padding=(0, 0),
        collapse_padding=True,
        header_style="bold",
        title=title,
        title_justify="left",
    )
    for heading in shown:
        if heading in _METHOD:
            table.add_column(heading, overflow="fold", vertical="top")
        elif heading in ("failures", "failed picks"):
            table.add_column(heading)
        else:
            table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*(row[heading] for heading in shown))
    return table


def _row(cell: CellSummary) -> dict[str, str]:
    """All columns of a row by their headings, in their order."""
    return {
        "suite": escape(cell.suite),
        "detector": escape(cell.detector),
        "controller": escape(cell.controller),
        "n": str(cell.n),
        "success": str(cell.successes),
        "rate\n%": _number(cell.rate and 100 * cell.rate),
        "95 %\ninterval": f"{100 * cell.wilson_low:.1f}-{100 * cell.wilson_high:.1f}",
        _MEDIAN: _number(cell.median_time_s),
        _MEAN: _number(cell.mean_time_s),
        _MEAN_WITH: _with_interval(cell.mean_time_s, cell.mean_time_low, cell.mean_time_high),
        "stops\n(singular)": stops_text(cell),
        "errors": str(cell.errors),
        "failures": _causes(cell.failures),
        **dict(zip(_CLEARING, _clearing(cell.clearing), strict=True)),
    }


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
    """Print the table of a run: whole into pipes and files, with fewer columns on a narrow terminal."""
    console = wide_console(console)
    if not cells:
        console.print("No episode was finished.")
        return
    for without in _NARROWER:
        table = result_table(cells, without)
        if Measurement.get(console, console.options.update_width(_ENDLESS), table).maximum <= console.width:
            break
    console.print(table)


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
