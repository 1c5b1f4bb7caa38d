"""The plots of a report, as SVG that stands inside of the page and takes on its colours.

Text stays text, in the page's ink, so that it can be read in the dark and searched. Figures are narrow:
beside each other on a wide screen, one below the other on a telephone.
"""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from mpgrasp.bench.results.trace import Trace
from mpgrasp.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 4.6
"""Of a figure [inch]; the page shows it at most 32 rem wide."""
GOOD, BAD, OTHER = "#2a7fce", "#d9622b", "#8a8f98"
"""Success, failure, and what the paper reports; told apart without red and green."""
INK = "#010203"
"""Stands for the page's ink until the SVG is written."""

Curves = Mapping[str, Sequence[tuple[float, float, float, float]]]
"""(x, rate, low, high) of each point, by the line's label."""

_LABEL = 24  # characters of a row's name in a line
_STYLE = {
    "font.size": 9.5,
    "font.family": "DejaVu Sans",
    "svg.fonttype": "none",
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "axes.grid": True,
    "grid.color": OTHER,
    "grid.alpha": 0.3,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}


@dataclass(frozen=True, kw_only=True)
class Bar:
    """A row of the plot of success rates."""

    label: str
    rate: float
    low: float
    high: float
    reported: tuple[float, float, float] | None = None
    """Rate, low and high that the paper reports."""


@dataclass(frozen=True, kw_only=True)
class Way:
    """A row of a plot of traces."""

    label: str
    traces: Sequence[tuple[bool, Trace]]
    """(success, trace) of each episode that has one."""


def success_picture(bars: Sequence[Bar], alt: str) -> str:
    """Success rates with their intervals, and the paper's beside them."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, bar in enumerate(bars):
            _interval(axes, k, (bar.rate, bar.low, bar.high), "o", GOOD, "here" if k == 0 else None)
            if bar.reported:
                first = not any(b.reported for b in bars[:k])
                _interval(axes, k + 0.3, bar.reported, "D", OTHER, "paper" if first else None)
        _rows(axes, [bar.label for bar in bars])
        axes.set(xlim=(-2, 102), xlabel="success [%], with 95 % Wilson intervals")
        _legend_above(figure)

    return _svg(draw, 1.0 + 0.42 * len(bars), alt)


def time_picture(times: Mapping[str, tuple[Sequence[float], Sequence[float]]], alt: str) -> str:
    """Boxes of the times [s] of each cell: (of successes, of failures), each episode a mark."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
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
                    height = k + rng.uniform(-0.2, 0.2, len(values))
                    axes.plot(
                        values,
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
        _rows(axes, list(times))
        axes.set(xlabel="simulated time [s]")
        longest = max(time_s for pair in times.values() for values in pair for time_s in values)
        axes.set_xlim(0, 1.05 * longest or 1.0)  # with room for the last tick's label
        _legend_above(figure)

    return _svg(draw, 1.0 + 0.42 * len(times), alt)


def singular_picture(ways: Sequence[Way], warning: float | None, alt: str) -> str:
    """Smallest singular value over time, a panel per cell, an episode a line.

    Args:
        ways: the cells.
        warning: level below which the arm counts as near a singularity; None where it is not known.
        alt: description.
    """

    def draw(figure: Figure) -> None:
        panels = figure.subplots(len(ways), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for axes, way in zip(panels, ways, strict=True):
            for success, trace in sorted(way.traces, key=lambda item: not item[0]):
                colour, name = (GOOD, "success") if success else (BAD, "failure")
                axes.plot(trace.times, trace.singular_values, color=colour, lw=0.9, alpha=0.8, label=name)
                if not success:
                    axes.plot(trace.times[-1], trace.singular_values[-1], "x", color=colour, ms=5)
            if warning is not None:
                axes.axhline(warning, color=INK, lw=0.8, ls="--", label=f"near a singularity ({warning:g})")
            axes.set_title(way.label, fontsize=9.5, loc="left")
            axes.set_ylim(bottom=0)
            axes.locator_params(axis="y", nbins=3)
        panels[-1].set_xlabel("simulated time [s]")
        figure.supylabel("smallest singular value", fontsize=9.5)
        _legend_above(figure)

    return _svg(draw, 1.0 + 1.05 * len(ways), alt)


def way_picture(
    examples: Sequence[tuple[str, Trace]], extent: tuple[float, float, float, float] | None, alt: str
) -> str:
    """Ways of the tool point from above, each over the entropy map of its last look.

    Args:
        examples: (title, trace), side by side.
        extent: x from, x to, y from, y to of the map [m]; None where it is not known: no map then.
        alt: description.
    """

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(examples), squeeze=False)[0]
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
        _legend_above(figure)

    return _svg(draw, 2.9 if len(examples) > 1 else 3.9, alt)


def thickness_picture(panels: Mapping[str, Curves], what: str, alt: str) -> str:
    """Rates against thickness [mm], a panel per title, the lines of one beside each other.

    Args:
        panels: curves by title.
        what: label of the rates [%].
        alt: description.
    """

    def draw(figure: Figure) -> None:
        for axes, (title, curves) in zip(
            figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0], panels.items(), strict=True
        ):
            shades = np.linspace(0, 1, len(curves)).tolist()
            for k, (label, points) in enumerate(curves.items()):
                thickness, *rates = np.array(points, float).T
                rate, low, high = (100 * values for values in rates)
                axes.errorbar(
                    thickness + 0.12 * (k - (len(curves) - 1) / 2), rate,
                    yerr=np.maximum([rate - low, high - rate], 0), marker="osD^v<>"[k % 7], ms=4, lw=1,
                    capsize=2, color=_mix(GOOD, BAD, shades[k]), label=label,
                )  # fmt: skip
            axes.set_title(title, fontsize=9.5, loc="left")
            axes.set(ylim=(-2, 102), ylabel=what)
        axes.set_xlabel("thickness [mm]")
        _legend_above(figure, columns=2)

    return _svg(draw, 1.2 + 1.7 * len(panels), alt)


def data_uri(picture: bytes, kind: str = "webp") -> str:
    """A picture as the source of an `<img>`."""
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode()}"


def _interval(
    axes: Axes, row: float, values: tuple[float, float, float], marker: str, colour: str, name: str | None
) -> None:
    rate, low, high = (100 * value for value in values)
    bars = np.maximum([[rate - low], [high - rate]], 0)
    axes.errorbar(rate, row, xerr=bars, fmt=marker, ms=5, capsize=3, lw=1.4, color=colour, label=name)


def _rows(axes: Axes, labels: Sequence[str]) -> None:
    """One row per label, the first on top; long names are folded, to leave room for what is drawn."""
    axes.set_yticks(range(len(labels)), ["\n".join(wrap(label, _LABEL)) for label in labels])
    for text in axes.get_yticklabels():
        text.set_fontsize(7.5 if "\n" in text.get_text() else 9.5)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)


def _legend_above(figure: Figure, columns: int = 3) -> None:
    found: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if found:
        ncols = columns if max(map(len, found)) < 30 else 1
        figure.legend(list(found.values()), list(found), loc="outside upper center", ncols=ncols)


def _mix(a: str, b: str, share: float) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    mixed: FloatArray = (1 - share) * np.array(to_rgb(a)) + share * np.array(to_rgb(b))
    return tuple(mixed.tolist())


def _svg(draw: Callable[[Figure], None], height: float, alt: str) -> str:
    """A figure as an `<svg>` element, the same bytes for the same drawing."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    # ids are made from the salt and the drawing: two pictures of a page must not share one
    settings: Any = {**_STYLE, "svg.hashsalt": alt}
    with matplotlib.rc_context(settings):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        file = io.StringIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
    text = file.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    # its style sheet would be the whole page's, and of its ids only those that are referred to are its own
    text = re.sub(r"<style.*?</style>", "", text, flags=re.DOTALL)
    referred = set(re.findall(r"#([A-Za-z][\w.-]*)", text))
    text = re.sub(r' id="([^"]*)"', lambda match: match[0] if match[1] in referred else "", text)
    text = text.replace(INK, "currentColor").replace("'DejaVu Sans'", "system-ui, sans-serif")
    head, _, rest = text.partition(">")
    head = re.sub(r' (width|height|version|xmlns(:xlink)?)="[^"]*"', "", head)
    name = html.escape(alt, quote=True)
    style = "stroke-linejoin:round;stroke-linecap:butt"
    return f'{head} role="img" aria-label="{name}" style="{style}">{rest.strip()}'
