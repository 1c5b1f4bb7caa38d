"""Thin objects in a report: success in its own episodes, or the published study of the same weights."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpgrasp.bench.record import played
from mpgrasp.bench.report.document import Figure
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.svg import BAD, GOOD, legend_above, svg
from mpgrasp.bench.results.runs import Run, Runs
from mpgrasp.geometry import FloatArray
from mpgrasp.paths import BENCHMARKS
from mpgrasp.statistics import wilson_interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

SUITE = "thickness"
"""The suite whose episodes are shown by thickness."""
STUDY = BENCHMARKS / "results" / "thickness" / "thickness.json"
"""Results of `benchmarks/thickness.py` in a checkout, with a run.json beside them."""

Point = tuple[float, float, float, float]
"""Thickness [mm], rate, low and high."""
Curves = Mapping[str, Sequence[Point]]
"""Points by the label of their line."""

_UNUSABLE = (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError)


@dataclass(frozen=True, kw_only=True)
class ThinObjects:
    """Success or detection against the thickness of a stick."""

    figure: Figure
    study_command: str = ""
    """The command of the published study, where the figure is of that and not of these runs."""


def thin_objects(evaluation: Evaluation, study: Path = STUDY) -> ThinObjects | None:
    """Success by thickness if suite `thickness` was run; else the study of frames if its weights were.

    None where neither is the case: what is known of other detectors does not belong into the report.
    """
    if SUITE in evaluation.runs.suites:
        return _from_episodes(evaluation)
    return _from_study(evaluation.runs, study)


def _from_episodes(evaluation: Evaluation) -> ThinObjects | None:
    curves: dict[str, list[Point]] = {}
    said = []
    for cell in evaluation.cells(SUITE):
        thicknesses = _thicknesses(evaluation.runs.owners[cell])
        endings: dict[float, list[bool]] = {}
        for line in played(evaluation.runs.cells[cell]):
            if line.object in thicknesses:
                endings.setdefault(thicknesses[line.object], []).append(line.success)
        name, counts = name_of(cell.method), sorted((mm, sum(v), len(v)) for mm, v in endings.items())
        if counts:
            curves[name] = [(mm, k / n, *wilson_interval(k, n)) for mm, k, n in counts]
            said.append(f"{name} {', '.join(f'{mm:g} mm {k}/{n}' for mm, k, n in counts)}")
    if not curves:
        return None
    alt = f"Success by the thickness of a stick: {'; '.join(said)}."
    figure = Figure(
        caption=f"{SUITE}: success by thickness of the stick; 95 % Wilson intervals",
        alt=alt,
        svg=thickness_plot({"": curves}, "success [%]", alt),
    )
    return ThinObjects(figure=figure)


def _thicknesses(run: Run) -> dict[str, float]:
    """Thickness of the suite's boxes by name [mm], as run.json declares them."""
    scenes = [s for part in run.configuration.parts if part.suite.name == SUITE for s in part.suite.scenes]
    found = {}
    for item in (item for scene in scenes for item in scene.get("objects") or ()):
        parts = item.get("parts") if isinstance(item, Mapping) else None
        if isinstance(parts, list) and len(parts) == 1 and parts[0].get("shape") == "box":
            found[str(item["name"])] = 2000 * float(min(parts[0]["size"]))
    return found


def _from_study(runs: Runs, study: Path) -> ThinObjects | None:
    try:
        about = json.loads(study.with_name("run.json").read_text(encoding="utf-8"))
        shared = _shared(runs, about["weights_sha256"])
        cells = json.loads(study.read_text(encoding="utf-8"))["cells"]
        seen = [cell for cell in cells if cell["detector"] in shared and cell["thickness_mm"]]
        if not seen:
            return None
        thinnest = min(cell["thickness_mm"] for cell in seen)
        said = "; ".join(
            f"{c['detector']} at {c['tcp_height_m']:g} m {100 * c['detected']['rate']:.0f} %"
            for c in seen if c["thickness_mm"] == thinnest
        )  # fmt: skip
        alt = f"Detection rate against the thickness of a stick. At {thinnest:g} mm: {said}."
        drawing = thickness_plot(_curves(seen), "detected [%]", alt)
        command = str(about["command"])
    except _UNUSABLE:
        return None
    caption = "how thin a stick is still detected, by height of the tool point; 95 % Wilson intervals"
    return ThinObjects(figure=Figure(caption=caption, alt=alt, svg=drawing), study_command=command)


def _shared(runs: Runs, published: Mapping[str, str | None]) -> set[str]:
    """Detectors of the study that played in these runs, with the same weights in all of them."""
    here: dict[str, set[str | None]] = {}
    for run in runs.runs:
        for detector in run.configuration.detectors:
            here.setdefault(detector.name, set()).add(detector.sha256)
    return {name for name, sha256 in published.items() if sha256 and here.get(name) == {sha256}}


def _curves(cells: Sequence[Mapping[str, Any]]) -> dict[str, Curves]:
    """A panel per detector, a line per height."""
    panels: dict[str, dict[str, list[Point]]] = {}
    for cell in cells:
        lines = panels.setdefault(str(cell["detector"]), {})
        rate, low, high = (cell["detected"][key] for key in ("rate", "wilson_low", "wilson_high"))
        point = float(cell["thickness_mm"]), rate, low, high
        lines.setdefault(f"tool at {cell['tcp_height_m']:g} m", []).append(point)
    return dict(panels)


def thickness_plot(panels: Mapping[str, Curves], what: str, alt: str) -> str:
    """Rates against thickness [mm], a panel per title, the lines of one beside each other.

    Args:
        panels: curves by title.
        what: label of the rates [%].
        alt: description.
    """

    def draw(canvas: Canvas) -> None:
        for axes, (title, curves) in zip(
            canvas.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0], panels.items(), strict=True
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
        legend_above(canvas, columns=2)

    return svg(draw, 1.2 + 1.7 * len(panels), alt)


def _mix(a: str, b: str, share: float) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    mixed: FloatArray = (1 - share) * np.array(to_rgb(a)) + share * np.array(to_rgb(b))
    return tuple(mixed.tolist())
