"""Figures of the arm's motion, drawn from the traces that were kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpgrasp.bench.record import Cell
from mpgrasp.bench.report.document import Figure
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.kept_traces import KeptTraces, MissingTraces, Traced, missing_traces
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.svg import BAD, GOOD, INK, legend_above, svg
from mpgrasp.bench.results.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

Extent = tuple[float, float, float, float]
"""Bounds of a map in x, then in y [m]."""


@dataclass(frozen=True, kw_only=True)
class SuiteMotion:
    """Motion of the arm in the episodes of one suite."""

    suite: str
    singular_values: Sequence[Figure]
    """One figure of all cells; none where no trace was kept."""
    ways: Sequence[Figure]
    """A figure of each cell."""
    missing: MissingTraces | None
    """Cells that are not in the figures."""


def motion_figures(evaluation: Evaluation, suite: str, kept: KeptTraces) -> SuiteMotion:
    """Singular values over time and ways over the entropy map, as far as traces were kept."""
    cells = evaluation.cells(suite)
    drawn = [cell for cell in cells if kept.by_cell[cell]]
    return SuiteMotion(
        suite=suite,
        singular_values=[_singular_figure(evaluation, suite, drawn, kept)] if drawn else [],
        ways=[_way_figure(evaluation, cell, kept) for cell in drawn],
        missing=missing_traces(evaluation.runs, cells, kept),
    )


def _singular_figure(evaluation: Evaluation, suite: str, cells: Sequence[Cell], kept: KeptTraces) -> Figure:
    panels = {name_of(cell.method): kept.by_cell[cell] for cell in cells}
    warning = evaluation.runs.owners[cells[0]].about.motion.get("singularity_warning")
    said = (f"{name} {_lowest(traced)} in {len(traced)} episodes" for name, traced in panels.items())
    alt = f"Smallest singular value over time, suite {suite}: {'; '.join(said)}."
    return Figure(
        caption=f"{suite}: smallest singular value over time, of the episodes whose traces were kept",
        alt=alt,
        svg=singular_plot(panels, warning, alt),
    )


def _lowest(traced: Sequence[Traced]) -> str:
    values = np.concatenate([trace.singular_values for _, trace in traced])
    measured = values[np.isfinite(values)]  # open loop looks once before it moves
    return f"down to {measured.min():.3f}" if measured.size else "not measured"


def _way_figure(evaluation: Evaluation, cell: Cell, kept: KeptTraces) -> Figure:
    examples = [(f"{word}, episode {line.episode}", trace) for word, (line, trace) in kept.examples(cell)]
    said = "; ".join(
        f"{title}, from ({t.positions[0, 0]:.2f}, {t.positions[0, 1]:.2f}) m to "
        f"({t.positions[-1, 0]:.2f}, {t.positions[-1, 1]:.2f}) m"
        for title, t in examples
    )
    name, extent = name_of(cell.method), evaluation.runs.owners[cell].map_extent(cell)
    mapped = extent and any(trace.entropy is not None for _, trace in examples)
    under = "over the entropy map of the last look" if mapped else "without an entropy map"
    alt = f"Way of the tool point from above, suite {cell.suite}, {name}: {said}."
    return Figure(
        caption=f"{cell.suite}: {name}, way of the tool point from above, {under}",
        alt=alt,
        svg=way_plot(examples, extent, alt),
    )


def singular_plot(panels: Mapping[str, Sequence[Traced]], warning: float | None, alt: str) -> str:
    """Smallest singular value over time, a panel per cell, an episode a line.

    Args:
        panels: episodes of each cell, by its name.
        warning: level below which the arm counts as near a singularity; None where it is not known.
        alt: description.
    """

    def draw(canvas: Canvas) -> None:
        rows = canvas.subplots(len(panels), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, (label, traced) in zip(rows, panels.items(), strict=True):
            for line, trace in sorted(traced, key=lambda item: not item[0].success):
                colour, name = (GOOD, "success") if line.success else (BAD, "failure")
                axes.plot(trace.times, trace.singular_values, color=colour, lw=0.9, alpha=0.8, label=name)
                if not line.success:
                    axes.plot(trace.times[-1], trace.singular_values[-1], "x", color=colour, ms=5)
            if warning is not None:
                axes.axhline(warning, color=INK, lw=0.8, ls="--", label=f"near a singularity ({warning:g})")
            axes.set_title(label, fontsize=9.5, loc="left")
            axes.set_ylim(bottom=0)
            axes.locator_params(axis="y", nbins=3)
        rows[-1].set_xlabel("simulated time [s]")
        canvas.supylabel("smallest singular value", fontsize=9.5)
        legend_above(canvas)

    return svg(draw, 1.0 + 1.05 * len(panels), alt)


def way_plot(examples: Sequence[tuple[str, Trace]], extent: Extent | None, alt: str) -> str:
    """Ways of the tool point from above, each over the entropy map of its last look.

    Args:
        examples: (title, trace), side by side.
        extent: x from, x to, y from, y to of the map [m]; None where it is not known: no map then.
        alt: description.
    """

    def draw(canvas: Canvas) -> None:
        panels = canvas.subplots(1, len(examples), squeeze=False)[0]
        for axes, (title, trace) in zip(panels, examples, strict=True):
            x, y = trace.positions[:, 0], trace.positions[:, 1]
            if extent and trace.entropy is not None:
                # x of the world is away from the robot, y to its left: upwards and to the left here
                x0, x1, y0, y1 = extent
                axes.imshow(
                    trace.entropy.T, origin="lower", extent=(y0, y1, x0, x1), cmap="cividis",
                    interpolation="nearest",
                )  # fmt: skip
            axes.plot(y, x, color="white", lw=2.6)
            axes.plot(y, x, color="black", lw=1.1)
            axes.plot(y[0], x[0], "o", ms=6, color="white", mec="black", label="start")
            axes.plot(y[-1], x[-1], "s", ms=6, color="#ffb000", mec="black", label="end")
            axes.set_title(title, fontsize=9)
            axes.set_aspect("equal")
            axes.grid(False)
            # as much of the table as the way takes up, y of the world growing to the left
            middle = (trace.positions.max(axis=0) + trace.positions.min(axis=0))[:2] / 2
            half = max(0.15, float(np.ptp(trace.positions[:, :2], axis=0).max()) / 2 + 0.06)
            axes.set_xlim(middle[1] + half, middle[1] - half)
            axes.set_ylim(middle[0] - half, middle[0] + half)
            axes.locator_params(nbins=4)
            axes.set_xlabel("y [m]")
        panels[0].set_ylabel("x [m], away from the robot")
        legend_above(canvas)

    return svg(draw, 2.9 if len(examples) > 1 else 3.9, alt)
