"""Drawing of a report's figures: SVG that stands inside of the page and takes on its colours.

Text stays text, in the page's ink, so that it can be read in the dark and searched. Figures are narrow:
beside each other on a wide screen, one below the other on a telephone.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Callable, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

WIDTH = 4.6
"""Width of a figure [inch]; the page shows it at most 32 rem wide."""
GOOD, BAD, OTHER = "#2a7fce", "#d9622b", "#8a8f98"
"""Success, failure, and what the paper reports; told apart without red and green."""
INK = "#010203"
"""Stands for the page's ink until the SVG is written."""

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


def svg(draw: Callable[[Canvas], None], height: float, alt: str) -> str:
    """A figure as an `<svg>` element, the same bytes for the same drawing."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    # ids are made from the salt and the drawing: two figures of a page must not share one
    settings: Any = {**_STYLE, "svg.hashsalt": alt}
    with matplotlib.rc_context(settings):
        canvas = Canvas(figsize=(WIDTH, height), layout="constrained")
        FigureCanvasSVG(canvas)
        draw(canvas)
        file = io.StringIO()
        canvas.savefig(file, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
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


def legend_above(canvas: Canvas, columns: int = 3) -> None:
    """Add one legend of all axes above them; each label stands in it once."""
    found: dict[str, Any] = {}
    for axes in canvas.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if found:
        ncols = columns if max(map(len, found)) < 30 else 1
        canvas.legend(list(found.values()), list(found), loc="outside upper center", ncols=ncols)


def name_rows(axes: Axes, labels: Sequence[str]) -> None:
    """Give a row to each label, the first on top; long names are folded, to leave room for what is drawn."""
    axes.set_yticks(range(len(labels)), ["\n".join(wrap(label, _LABEL)) for label in labels])
    for text in axes.get_yticklabels():
        text.set_fontsize(7.5 if "\n" in text.get_text() else 9.5)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)
