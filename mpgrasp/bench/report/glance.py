"""What a report shows first: all rates in one picture, floor and ceiling among them, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from mpgrasp.bench.analysis.summary import CellSummary
from mpgrasp.bench.record import Method
from mpgrasp.bench.report.document import Figure
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.intervals import rate_text
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.svg import GOOD, INK, OTHER, legend_above, name_rows, svg
from mpgrasp.statistics import SIGNIFICANCE

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

MOST = 30
"""Cells that one picture holds; more are left to the tables."""
FLOOR = ("heuristic", "straight_down")
"""Detector that nobody trained, and controller that never moves sideways: what must be beaten."""

_COLOURS = {"ceiling": INK, "method": GOOD, "floor": OTHER}
_NAMES = {"ceiling": "ceiling: knows the truth", "method": "method", "floor": "floor: nothing learned"}


class _Row(NamedTuple):
    label: str
    kind: str
    summary: CellSummary


@dataclass(frozen=True, kw_only=True)
class Glance:
    """What a reader sees in five seconds."""

    figure: Figure
    verdicts: Sequence[str]
    """A sentence on each suite."""


def glance(evaluation: Evaluation) -> Glance | None:
    """Return picture and sentences; None for ladders and sweeps, which have their own, and for many cells."""
    others = {
        run.folder for run in evaluation.runs.runs if run.configuration.ladder or run.configuration.sweep
    }
    shown = [
        row
        for cell, row in evaluation.summaries.items()
        if row.n and evaluation.runs.owners[cell].folder not in others
    ]
    if not shown or len(shown) > MOST:
        return None
    suites = list(dict.fromkeys(row.cell.suite for row in shown))
    rows = []
    for suite in suites:
        of_suite = sorted((row for row in shown if row.cell.suite == suite), key=lambda row: -(row.rate or 0))
        before = f"{suite}: " if len(suites) > 1 else ""
        rows += [_Row(before + name_of(row.cell.method), _kind(evaluation, row), row) for row in of_suite]
    said = "; ".join(f"{row.label} {rate_text(row.summary.successes, row.summary.n)}" for row in rows)
    title = f"{', '.join(suites)}: success with 95 % intervals"
    alt = f"Success rates at a glance: {said}."
    figure = Figure(caption=title, alt=alt, svg=_plot(rows, alt))
    return Glance(figure=figure, verdicts=[_verdict(evaluation, suite, shown) for suite in suites])


def _kind(evaluation: Evaluation, row: CellSummary) -> str:
    cell = row.cell
    if evaluation.runs.owners[cell].reads_truth(cell.detector):
        return "ceiling"
    return "floor" if cell.detector in FLOOR or cell.controller in FLOOR else "method"


def _verdict(evaluation: Evaluation, suite: str, shown: Sequence[CellSummary]) -> str:
    """Which method does best in a suite, and how many others do significantly worse."""
    of_suite = [row for row in shown if row.cell.suite == suite]
    methods = [row for row in of_suite if _kind(evaluation, row) == "method"] or of_suite
    best = max(methods, key=lambda row: row.rate or 0)
    rate = rate_text(best.successes, best.n)
    said = f"{suite}: {name_of(best.cell.method)} succeeds in {rate}"
    if len(methods) > 1:
        said += f", the most of {len(methods)} methods"
    others = [row.cell.method for row in of_suite if row.cell != best.cell]
    if not others:
        return said + "."
    worse, better = _significant(evaluation, suite, best.cell.method)
    said += f"; significantly more than {worse} of {len(others)} others"
    return said + (f", and less than {better}." if better else ".")


def _significant(evaluation: Evaluation, suite: str, method: Method) -> tuple[int, int]:
    """How many others of a suite are significantly worse than a method, and how many better."""
    worse = better = 0
    for test in evaluation.tests:
        if test.suite == suite and test.p_holm < SIGNIFICANCE and method in (test.a, test.b):
            mine, theirs = (test.a_alone, test.b_alone) if test.a == method else (test.b_alone, test.a_alone)
            worse, better = worse + (mine > theirs), better + (mine < theirs)
    return worse, better


def _plot(rows: Sequence[_Row], alt: str) -> str:
    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots()
        drawn: set[str] = set()
        for k, row in enumerate(rows):
            found, colour = row.summary, _COLOURS[row.kind]
            low, high = 100 * found.wilson_low, 100 * found.wilson_high
            axes.plot([low, high], [k, k], color=colour, lw=2, solid_capstyle="round")
            label = None if row.kind in drawn else _NAMES[row.kind]
            axes.plot(100 * (found.rate or 0), k, "o", ms=7, color=colour, label=label, clip_on=False)
            drawn.add(row.kind)
        name_rows(axes, [row.label for row in rows])
        axes.set(xlim=(-2, 102), xlabel="success [%]")
        if len(drawn) > 1:
            legend_above(canvas)

    return svg(draw, 1.0 + 0.3 * len(rows), alt)
