"""Curves of a training: one row a validation, as a table (CSV) and as a picture (PNG)."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from mpgrasp.exceptions import OutputError

Rows = Sequence[Mapping[str, float]]

PANELS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("loss", ("loss", "validation_loss")),
    ("parts of the loss", ("pos", "cos", "sin", "width")),
    ("validation", ("score", "hit", "rectangle", "label_quality", "lift")),
    ("hits by group", ("hit_thin", "hit_thick", "hit_low", "hit_mid", "hit_high")),
)
"""Title and columns of each panel of the picture."""
SIDE = 3.4
"""Side of a panel [inch]."""


def write_curves(table: Path, rows: Rows) -> None:
    """Write `table` (CSV), and a picture of the same name beside it.

    Args:
        table: file to write; a column that a row lacks stays empty.
        rows: what was known at each validation, oldest first; "images" is the abscissa.

    Raises:
        OutputError: a file cannot be written.
    """
    try:
        table.parent.mkdir(parents=True, exist_ok=True)
        with table.open("w", encoding="utf-8", newline="") as file:
            columns = list(dict.fromkeys(name for row in rows for name in row))
            writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows({k: f"{v:.6g}" for k, v in row.items()} for row in rows)
        _draw(table.with_suffix(".png"), table.stem, rows)
    except OSError as error:
        raise OutputError(f"curves cannot be written: {error}", got=str(table)) from error


def _draw(path: Path, title: str, rows: Rows) -> None:
    # a figure of its own instead of pyplot: no display, no global state
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(len(PANELS) * SIDE, SIDE), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, columns) in zip(figure.subplots(1, len(PANELS)), PANELS, strict=True):
        for column in columns:
            points = [(row["images"], row[column]) for row in rows if column in row]
            if points:
                axes.plot(*zip(*points, strict=True), marker=".", label=column)
        axes.set_title(name, fontsize=10)
        axes.set_xlabel("images seen")
        axes.locator_params(axis="x", nbins=4)
        axes.grid(alpha=0.3)
        if "loss" in name:
            axes.set_yscale("log")
        else:
            axes.set_ylim(0, 1)
        if axes.lines:
            axes.legend(fontsize=7)
    figure.suptitle(title, fontsize=11)
    figure.savefig(path, dpi=110)
