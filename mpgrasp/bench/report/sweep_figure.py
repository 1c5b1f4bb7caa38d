"""Figure of success and time over the values of one setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpgrasp.bench.report.svg import BAD, GOOD, INK, OTHER, legend_above, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

Interval = tuple[float, float, float]
"""A value with its lower and its upper bound."""

_COLOURS, _MARKERS = (GOOD, BAD, INK, OTHER), ("o", "s", "^", "D", "v")
_WIDE = 30
"""Largest value over smallest, all positive, from which on values are spread by their logarithms."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Results of a method over the values of a setting."""

    name: str
    values: Sequence[float]
    success: Sequence[Interval]
    """[%]"""
    time: Sequence[Interval]
    """Mean simulated times [s]."""


def sweep_plot(curves: Sequence[Curve], setting: str, alt: str) -> str:
    """Success above, time below, a line for each method."""

    def draw(canvas: Canvas) -> None:
        above, below = canvas.subplots(2, 1, sharex=True)
        for k, curve in enumerate(curves):
            _line(above, curve, curve.success, k)
            _line(below, curve, curve.time, k)
        above.set(ylim=(-4, 104), ylabel="success [%]")
        below.set(xlabel=setting, ylabel="mean time [s]")
        below.set_ylim(bottom=0)
        values = [value for curve in curves for value in curve.values]
        if values and min(values) > 0 and max(values) >= _WIDE * min(values):
            below.set_xscale("log")
        if len(curves) > 1:
            legend_above(canvas, columns=2)

    return svg(draw, 4.2, alt)


def _line(axes: Axes, curve: Curve, intervals: Sequence[Interval], k: int) -> None:
    middle, low, high = np.array(intervals, float).reshape(-1, 3).T
    axes.errorbar(
        curve.values, middle, yerr=np.maximum([middle - low, high - middle], 0),
        fmt=_MARKERS[k % len(_MARKERS)], ls="-", ms=5, lw=1.2, capsize=3,
        color=_COLOURS[k % len(_COLOURS)], label=curve.name,
    )  # fmt: skip
