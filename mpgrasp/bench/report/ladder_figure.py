"""Figure of a ladder: success over the levels, from the easy on the left to the hard on the right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpgrasp.bench.analysis.ladder import RATES
from mpgrasp.bench.report.svg import OTHER, legend_above, svg
from mpgrasp.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_COLOURS = ("#2a7fce", "#d9622b", "#3a9a5b", "#b05fa8", "#c29a1e", "#5fb3d9", "#7a7f88")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")


@dataclass(frozen=True, kw_only=True, eq=False)
class Ascended:
    """How far a method got, to be drawn."""

    name: str
    levels: FloatArray
    """(n,) places of the curve."""
    rate: FloatArray
    low: FloatArray
    high: FloatArray
    """(n,) the curve and its interval [%]."""
    rungs: Sequence[float]
    rates: Sequence[float]
    """Success at each rung [%]."""
    intervals: Sequence[tuple[float, float]]
    """Wilson interval of each [%]."""
    numbers: Sequence[int]
    """Episodes of each."""


def ladder_plot(drawn: Sequence[Ascended], axis: str, alt: str, *, logarithmic: bool, falling: bool) -> str:
    """Success over the levels, a curve for each method.

    Args:
        drawn: the methods.
        axis: words under the axis.
        alt: description of the figure.
        logarithmic: True where the ratio of two levels is what counts.
        falling: True where lower levels are harder, so that they stand on the right.
    """

    def draw(canvas: Canvas) -> None:
        axes = canvas.subplots()
        for rate in RATES:
            axes.axhline(100 * rate, color=OTHER, lw=0.8, ls=":")
        for k, of in enumerate(drawn):
            colour = _COLOURS[k % len(_COLOURS)]
            axes.plot(of.levels, of.rate, color=colour, lw=1.6, label=of.name)
            axes.fill_between(of.levels, of.low, of.high, color=colour, alpha=0.15, lw=0)
            sizes = [14 + 0.9 * n for n in of.numbers]
            axes.scatter(
                of.rungs, of.rates, s=sizes, color=colour, marker=_MARKERS[k % len(_MARKERS)], zorder=3, lw=0
            )
        axes.set(ylim=(-4, 104), ylabel="success [%]", xlabel=axis)
        if logarithmic:
            axes.set_xscale("log")
            ticks = sorted({rung for of in drawn for rung in of.rungs})
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=8)
            axes.minorticks_off()
        if falling:
            axes.invert_xaxis()
        legend_above(canvas, columns=2)

    assert np.all([len(of.levels) == len(of.rate) for of in drawn])
    return svg(draw, 3.6, alt)
