"""Tables of a report beside the paper's own: results, how the arm moved, failures, runs, physics card."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

from mpgrasp.bench.record import ERROR
from mpgrasp.bench.report.document import Block, Folded, Listing, Paragraph, Table
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.paper_tables import Rows, rate_text, time_text
from mpgrasp.bench.results.runs import Run, Runs
from mpgrasp.episode.stages import STAGES
from mpgrasp.files.json_values import Difference, difference

CARD = ("physics", "camera", "motion", "ik", "reflex")
"""Keys of run.json that make up the physics card."""
_MOTION = (
    ("min_singular_value", "smallest singular value, median"),
    ("near_singularity_s", "near a singularity [s]"),
    ("path_length_m", "path [m]"),
    ("jerk_rms", "jerk, RMS [m/s3]"),
    ("spectral_arc_length", "spectral arc length"),
    ("first_detection_s", "first detection [s]"),
    ("blind_drift_m", "drift before it [m]"),
)


def overview_table(rows: Rows) -> Table:
    """One row per cell: successes, times, stops, failures."""
    return Table(
        caption="Results",
        headings=(
            "suite",
            "cell",
            "success",
            "median time",
            "mean time",
            "reflex stops",
            "failures by cause",
        ),
        rows=[
            (
                suite,
                name_of(detector, controller),
                rate_text(row["successes"], row["n"], row["errors"]),
                "-" if row["median_time_s"] is None else f"{row['median_time_s']:.1f} s",
                time_text(row) + (" *" if row["time_limit_s"] is not None else ""),
                _counts(row["reflexes"]) or "0",
                _counts(row["failures"]) or "none",
            )
            for (suite, detector, controller), row in rows.items()
        ],
        note="Rates with 95 % Wilson intervals, mean simulated times with 95 % bootstrap intervals; * "
        "restricted to the time limit, which an episode of the suite hit. Errors are episodes that could not "
        "be played, and are no failures.",
    )


def object_blocks(runs: Runs, rows: Rows) -> list[Block]:
    """Successes by object, of suites with several, and the meshes that were given and not used."""
    blocks: list[Block] = []
    for suite in runs.suites:
        cells = [cell for cell in rows if cell[0] == suite]
        names = list(dict.fromkeys(name for cell in cells for name in rows[cell]["objects"]))
        if len(names) < 2:
            continue
        counts = [[rows[cell]["objects"].get(name) for cell in cells] for name in names]
        table = Table(
            caption=f"{suite}: successes by object",
            headings=("object", *(name_of(*cell[1:]) for cell in cells)),
            rows=[
                (name, *(f"{count['successes']}/{count['n']}" if count else "-" for count in row))
                for name, row in zip(names, counts, strict=True)
            ],
        )
        blocks.append(Folded(summary=table.caption, blocks=(table,)))
    refused = [
        (str(mesh.get("name")), str(mesh["reason"]))
        for run in runs.runs for mesh in run.about.get("objects") or () if mesh.get("reason")
    ]  # fmt: skip
    if refused:
        caption = f"Meshes that were given and not used: {len(refused)}"
        table = Table(caption=caption, headings=("mesh", "why"), rows=refused)
        blocks.append(Folded(summary=caption, blocks=(table,)))
    return blocks


def motion_table(rows: Rows) -> Table:
    """What the paper argues about the controllers, measured: medians over the episodes of each cell."""
    table = []
    for (suite, detector, controller), row in rows.items():
        motion, worst = row["motion"], row["worst_singular_value"]
        medians = (f"{motion[key]:.3g}" if key in motion else "-" for key, _ in _MOTION)
        lowest = "-" if worst is None else f"{worst:.3g}"
        table.append((suite, name_of(detector, controller), str(row["reflex_stops"]), lowest, *medians))
    return Table(
        caption="How the arm moved: medians over episodes",
        headings=("suite", "cell", "reflex stops", "smallest singular value", *(h for _, h in _MOTION)),
        rows=table,
        note="Smallest singular value of the tool's Jacobian (m, rad); - where it was not measured.",
    )


def timing_blocks(runs: Runs) -> list[Block]:
    """Where the wall-clock of a control tick goes, by cell, and the share of all but network inference."""
    rows, detect_ms, whole_ms = [], 0.0, 0.0
    for cell, lines in runs.cells.items():
        timed = [line["timing"] for line in lines if all(key in (line.get("timing") or ()) for key in STAGES)]
        if not timed:
            continue
        means = {stage: fmean(timing[stage] for timing in timed) for stage in STAGES}
        tick = sum(means.values())
        network = not runs.owners[cell].reads_truth(cell[1])
        if network:
            detect_ms, whole_ms = detect_ms + len(timed) * means["detect"], whole_ms + len(timed) * tick
        share = _share(means["detect"], tick) if network else "no network"
        values = (f"{means[stage]:.1f}" for stage in STAGES)
        rows.append((cell[0], name_of(*cell[1:]), str(len(timed)), f"{tick:.1f}", *values, share))
    if not rows:
        return [Paragraph(text="Not known: the lines of these runs hold no times of all stages.")]
    blocks: list[Block] = [
        Table(
            caption="Wall-clock of a control tick [ms]",
            headings=("suite", "cell", "n", "tick", *STAGES, "network inference"),
            rows=rows,
            note="Means over n episodes of the median of each stage of a tick of the reach; building scenes, "
            "grasping and lifting are not in it. Network inference is `detect`: the network with what "
            "prepares its image and smooths its maps.",
        )
    ]
    if whole_ms:
        said = f"everything apart from network inference: {_share(whole_ms - detect_ms, whole_ms)}"
        blocks.append(Paragraph(text=f"Of a control tick, over all cells with a network, {said}."))
    return blocks


def _share(part: float, whole: float) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"


def failure_blocks(runs: Runs) -> list[Block]:
    """Every failure and every error row, with the command that plays it again."""
    rows = [
        (
            line["suite"],
            name_of(line["detector"], line["controller"]),
            str(line["episode"]),
            str(line.get("scene_seed", "-")),
            str(line.get("object", "-")),
            _what(line, run),
            f"`{replay_command(run.folder, line)}`",
        )
        for run in runs.runs for line in run.lines if not line.get("success")
    ]  # fmt: skip
    if not rows:
        return [Paragraph(text="None: every episode was a success.")]
    table = Table(
        caption=f"Failures and errors: {len(rows)}",
        headings=("suite", "cell", "episode", "scene seed", "object", "what happened", "play it again"),
        rows=rows,
        note="The command plays the episode again, records it for rerun and as GIF, and says whether it is "
        "the same bit for bit.",
    )
    return [table] if len(rows) <= 30 else [Folded(summary=table.caption, blocks=(table,))]


def replay_command(folder: Path, line: Mapping[str, Any]) -> str:
    """The command that plays and records one episode of a run again."""
    cell = "/".join(line[key] for key in ("suite", "detector", "controller"))
    words = ["python", "-m", "mpgrasp.bench", "replay", str(folder), "--episode", str(line["episode"])]
    return shlex.join([*words, "--cell", cell, "--record"])


def run_blocks(runs: Runs) -> list[Block]:
    """The commands that made the runs, by which version, and in what they differ."""
    rows = []
    for run in runs.runs:
        made = run.about.get("made_with") or {}
        git = made.get("git") or {}
        commit = str(git.get("commit", "-"))[:12] + (" and changes" if git.get("modified") else "")
        seed = str(run.configuration.get("seed", "-"))
        state = {True: "complete", False: "not complete", None: "still running or cut short"}[run.complete]
        rows.append(
            (str(run.folder), str(len(run.lines)), state, seed, str(run.about.get("started", "-")), commit)
        )
    blocks: list[Block] = [
        Table(
            caption="Runs", headings=("folder", "episodes", "state", "seed", "started", "commit"), rows=rows
        ),
        Listing(lines=[str(run.about.get("command", "# command not known")) for run in runs.runs]),
    ]
    first, *others = runs.runs
    for run in others:
        for key in ("seed", "camera", "noise", "episode"):
            found = difference(first.configuration.get(key), run.configuration.get(key), key)
            if found:
                blocks.append(_not_the_same(found, first, run))
    return blocks


def card_blocks(runs: Runs) -> list[Block]:
    """Physics, camera and limits of the first run, and in what the others differ."""
    first, *others = runs.runs
    if not any(first.about.get(key) for key in CARD):
        return [Paragraph(text=f"`{first.folder}` has no physics card.")]
    blocks: list[Block] = []
    for key in CARD:
        content = dict(first.about.get(key) or {})
        geoms = content.pop("geoms", None) or {}
        if content:
            rows = [(name, _value(value)) for name, value in _flat(content)]
            blocks.append(Table(caption=f"{key}", headings=("setting", "value"), rows=rows))
        if geoms:
            blocks.append(_contact_table(geoms))
    for run in others:
        for key in CARD:
            found = difference(first.about.get(key), run.about.get(key), key)
            if found:
                blocks.append(_not_the_same(found, first, run))
                break
    return [Folded(summary="Physics, contacts, camera, motion and protective limits", blocks=blocks)]


def _not_the_same(found: Difference, first: Run, run: Run) -> Paragraph:
    said = found.words(f"in `{first.folder}`", f"in `{run.folder}`")
    return Paragraph(text=f"Not the same in all runs: {said}")


def _contact_table(geoms: Mapping[str, Any]) -> Table:
    """Contact settings, geoms with the same ones in one row."""
    alike: dict[str, list[str]] = {}
    for name, settings in geoms.items():
        alike.setdefault(json.dumps(settings), []).append(name)
    keys = list(dict.fromkeys(key for settings in geoms.values() for key in settings))
    rows = [
        (", ".join(names), *(_value(json.loads(settings).get(key)) for key in keys))
        for settings, names in alike.items()
    ]
    return Table(caption="contacts", headings=("geoms", *keys), rows=rows)


def _what(line: Mapping[str, Any], run: Run) -> str:
    if line.get("outcome") == ERROR:
        trace = line.get("traceback")
        return f"error: {line.get('error')}" + (f", see `{run.folder / trace}`" if trace else "")
    reflex = line.get("reflex") or {}
    why = f"{len(line['left'])} objects left" if line.get("left") else reflex.get("text")
    return f"{line['outcome']}" + (f": {why}" if why else "")


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def _flat(content: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, value in content.items():
        if isinstance(value, Mapping):
            found += _flat(value, f"{before}{key}.")
        else:
            found.append((f"{before}{key}", value))
    return found


def _value(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_value(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)
