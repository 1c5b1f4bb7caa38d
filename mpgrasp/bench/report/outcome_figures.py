"""Figures of success rates and times, two per suite."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mpgrasp.bench.analysis.paper import reported
from mpgrasp.bench.record import Cell, Line, played
from mpgrasp.bench.report.document import Figure
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.intervals import rate_text
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.svg import BAD, GOOD, INK, OTHER, legend_above, name_rows, svg
from mpgrasp.statistics import wilson_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

DRAWN = 1000
"""Successes, and failures, of a cell that have a mark of their own in a figure."""

Rate = tuple[float, float, float]
"""A success rate with the bounds of its interval, 0 to 1."""
Bar = tuple[str, Rate, Rate | None]
"""A cell's name, its rate here, and the paper's; None where the paper reports nothing of it."""
Times = tuple[Sequence[float], Sequence[float]]
"""Simulated times of successes and of failures [s]."""


def outcome_figures(evaluation: Evaluation, suite: str) -> list[Figure]:
    """Success rates and times of the cells of a suite; nothing where no episode could be played."""
    cells = [cell for cell in evaluation.cells(suite) if evaluation.summaries[cell].n]
    if not cells:
        return []
    return [_success_figure(evaluation, suite, cells), _time_figure(evaluation, suite, cells)]


def _success_figure(evaluation: Evaluation, suite: str, cells: Sequence[Cell]) -> Figure:
    paper = {evaluation.paper_cell(suite, method): counts for method, counts in reported(suite).items()}
    bars: list[Bar] = []
    said = []
    for cell in cells:
        name, row = name_of(cell.method), evaluation.summaries[cell]
        bars.append((name, _rate(row.successes, row.n), _rate(*paper[cell]) if cell in paper else None))
        said.append(f"{name} {rate_text(row.successes, row.n)}")
    alt = f"Success rates, suite {suite}: {'; '.join(said)}."
    return Figure(caption=f"{suite}: success", alt=alt, svg=success_plot(bars, alt))


def _time_figure(evaluation: Evaluation, suite: str, cells: Sequence[Cell]) -> Figure:
    medians = (f"{name_of(cell.method)} {evaluation.summaries[cell].median_time_s:.1f} s" for cell in cells)
    alt = f"Times, suite {suite}, medians: {'; '.join(medians)}."
    times = {name_of(cell.method): _times(evaluation.runs.cells[cell]) for cell in cells}
    thinned = f"; marks: {DRAWN} episodes of each, drawn at random" if _thinned(times) else ""
    return Figure(
        caption=f"{suite}: simulated times; boxes show quartiles, whiskers all episodes{thinned}",
        alt=alt,
        svg=time_plot(times, alt),
    )


def _rate(successes: int, n: int) -> Rate:
    return successes / n, *wilson_interval(successes, n)


def _times(lines: Sequence[Line]) -> Times:
    good, bad = array("d"), array("d")
    for line in played(lines):
        (good if line.success else bad).append(line.sim_time_s)
    return good, bad


def _thinned(times: Mapping[str, Times]) -> bool:
    return any(len(values) > DRAWN for pair in times.values() for values in pair)


def success_plot(bars: Sequence[Bar], alt: str) -> str:
    """Success rates with their intervals, and the paper's beside them."""

    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots()
        for k, (_, here, paper) in enumerate(bars):
            _interval(axes, k, here, "o", GOOD, "here" if k == 0 else None)
            if paper:
                first = not any(before for _, _, before in bars[:k])
                _interval(axes, k + 0.3, paper, "D", OTHER, "paper" if first else None)
        name_rows(axes, [label for label, _, _ in bars])
        axes.set(xlim=(-2, 102), xlabel="success [%], with 95 % Wilson intervals")
        legend_above(canvas)

    return svg(draw, 1.0 + 0.42 * len(bars), alt)


def time_plot(times: Mapping[str, Times], alt: str) -> str:
    """Boxes of the times [s] of each cell, (of successes, of failures), with marks for `DRAWN` of each."""

    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots()
        rng = np.random.default_rng(0)
        ink = {"color": INK, "linewidth": 0.9}
        for k, (good, bad) in enumerate(times.values()):
            axes.boxplot(
                [[*good, *bad]], positions=[k], orientation="horizontal", widths=0.55, showfliers=False,
                whis=(0, 100), manage_ticks=False, zorder=1,
                boxprops=ink, whiskerprops=ink, capprops=ink, medianprops=ink,
            )  # fmt: skip
            for values, colour, marker, name in ((good, GOOD, "o", "success"), (bad, BAD, "x", "failure")):
                if values:
                    drawn = rng.choice(values, DRAWN, replace=False) if len(values) > DRAWN else values
                    height = k + rng.uniform(-0.2, 0.2, len(drawn))
                    axes.plot(
                        drawn,
                        height,
                        marker,
                        ms=3.5,
                        color=colour,
                        alpha=0.7,
                        ls="",
                        label=name,
                        mew=0.8,
                        zorder=3,
                    )
        name_rows(axes, list(times))
        axes.set(xlabel="simulated time [s]")
        longest = max(max(values) for pair in times.values() for values in pair if values)
        axes.set_xlim(0, 1.05 * longest or 1.0)  # with room for the last tick's label
        legend_above(canvas)

    return svg(draw, 1.0 + 0.42 * len(times), alt)


def _interval(axes: Axes, row: float, values: Rate, marker: str, colour: str, name: str | None) -> None:
    rate, low, high = (100 * value for value in values)
    bars = np.maximum([[rate - low], [high - rate]], 0)
    axes.errorbar(rate, row, xerr=bars, fmt=marker, ms=5, capsize=3, lw=1.4, color=colour, label=name)
