"""Thin objects in a report: what its own episodes say, else what the published study says of its weights."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mpgrasp.bench.record import ERROR
from mpgrasp.bench.report.document import Block, Paragraph, Picture
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.plots import Curves, thickness_picture
from mpgrasp.bench.results.runs import Run, Runs
from mpgrasp.paths import BENCHMARKS
from mpgrasp.statistics import wilson_interval

SUITE = "thickness"
"""The suite whose episodes are shown by thickness."""
STUDY = BENCHMARKS / "results" / "thickness" / "thickness.json"
"""Results of `benchmarks/thickness.py` in a checkout, with a run.json beside them."""

_UNUSABLE = (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError)


def thickness_blocks(runs: Runs, study: Path = STUDY) -> list[Block]:
    """Success by thickness if suite `thickness` was run; else the study of frames if its weights were.

    Nothing where neither is the case: what is known of other detectors does not belong into the report.
    """
    return _of_episodes(runs) if SUITE in runs.suites else _of_study(runs, study)


def _of_episodes(runs: Runs) -> list[Block]:
    curves: dict[str, list[tuple[float, float, float, float]]] = {}
    said = []
    for cell, lines in runs.cells.items():
        if cell[0] != SUITE:
            continue
        thicknesses = _thicknesses(runs.owners[cell])
        verdicts: dict[float, list[bool]] = {}
        for line in lines:
            if line.get("outcome") != ERROR and line.get("object") in thicknesses:
                verdicts.setdefault(thicknesses[line["object"]], []).append(bool(line["success"]))
        name, counts = name_of(*cell[1:]), sorted((mm, sum(v), len(v)) for mm, v in verdicts.items())
        if counts:
            curves[name] = [(mm, k / n, *wilson_interval(k, n)) for mm, k, n in counts]
            said.append(f"{name} {', '.join(f'{mm:g} mm {k}/{n}' for mm, k, n in counts)}")
    if not curves:
        return []
    alt = f"Success by the thickness of a stick: {'; '.join(said)}."
    caption = f"{SUITE}: success by thickness of the stick; 95 % Wilson intervals"
    markup = thickness_picture({"": curves}, "success [%]", alt)
    return [Picture(caption=caption, alt=alt, markup=markup)]


def _thicknesses(run: Run) -> dict[str, float]:
    """Thickness of the suite's boxes by name [mm], as run.json declares them."""
    whole = run.configuration
    found = {}
    for card in (whole.get("suite"), *(item.get("suite") for item in whole.get("suites") or ())):
        if not isinstance(card, Mapping) or card.get("name") != SUITE:
            continue
        for item in (item for scene in card.get("scenes") or () for item in scene.get("objects") or ()):
            parts = item.get("parts") if isinstance(item, Mapping) else None
            if isinstance(parts, list) and len(parts) == 1 and parts[0].get("shape") == "box":
                found[str(item["name"])] = 2000 * float(min(parts[0]["size"]))
    return found


def _of_study(runs: Runs, study: Path) -> list[Block]:
    try:
        about = json.loads(study.with_name("run.json").read_text(encoding="utf-8"))
        shared = _shared(runs, about["weights_sha256"])
        cells = json.loads(study.read_text(encoding="utf-8"))["cells"]
        seen = [cell for cell in cells if cell["detector"] in shared and cell["thickness_mm"]]
        if not seen:
            return []
        thinnest = min(cell["thickness_mm"] for cell in seen)
        said = "; ".join(
            f"{c['detector']} at {c['tcp_height_m']:g} m {100 * c['detected']['rate']:.0f} %"
            for c in seen if c["thickness_mm"] == thinnest
        )  # fmt: skip
        alt = f"Detection rate against the thickness of a stick. At {thinnest:g} mm: {said}."
        markup = thickness_picture(_curves(seen), "detected [%]", alt)
        command = str(about["command"])
    except _UNUSABLE:
        return []
    caption = "how thin a stick is still detected, by height of the tool point; 95 % Wilson intervals"
    text = f"Not of these runs: the published study of single frames, of the same weights; `{command}`."
    return [Paragraph(text=text), Picture(caption=caption, alt=alt, markup=markup)]


def _shared(runs: Runs, published: Mapping[str, str | None]) -> set[str]:
    """Detectors of the study that played in these runs, with the same weights in all of them."""
    here: dict[str, set[str | None]] = {}
    for run in runs.runs:
        for detector in run.configuration.get("detectors") or ():
            here.setdefault(detector["name"], set()).add(detector.get("sha256"))
    return {name for name, sha256 in published.items() if sha256 and here.get(name) == {sha256}}


def _curves(cells: Sequence[Mapping[str, Any]]) -> dict[str, Curves]:
    """A panel per detector, a line per height."""
    panels: dict[str, dict[str, list[tuple[float, float, float, float]]]] = {}
    for cell in cells:
        lines = panels.setdefault(str(cell["detector"]), {})
        rate, low, high = (cell["detected"][key] for key in ("rate", "wilson_low", "wilson_high"))
        point = float(cell["thickness_mm"]), rate, low, high
        lines.setdefault(f"tool at {cell['tcp_height_m']:g} m", []).append(point)
    return dict(panels)
