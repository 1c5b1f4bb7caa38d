"""Tables of results by cell: successes, objects, how the arm moved, and where the time goes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mpgrasp.bench.analysis.tally import SINGULARITY
from mpgrasp.bench.record import Cell, played
from mpgrasp.bench.report.document import Table
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.intervals import counts_text, stops_text, success_text, time_text
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.results.runs import Runs
from mpgrasp.episode.stages import STAGES

_MOTION = (
    ("min_singular_value", "smallest singular value, median"),
    ("near_singularity_s", "near a singularity [s]"),
    ("path_length_m", "path [m]"),
    ("jerk_rms", "jerk, RMS [m/s3]"),
    ("spectral_arc_length", "spectral arc length"),
    ("first_detection_s", "first detection [s]"),
    ("blind_drift_m", "drift before it [m]"),
)


def overview_table(evaluation: Evaluation) -> Table:
    """Successes, times, stops and failures, one row per cell."""
    rows = []
    for cell, row in evaluation.summaries.items():
        middle = "-" if row.median_time_s is None else f"{row.median_time_s:.1f} s"
        mean = time_text(row) + (" *" if row.time_limit_s is not None else "")
        stops, failures = counts_text(row.reflexes) or "0", counts_text(row.failures) or "none"
        rows.append((cell.suite, name_of(cell.method), success_text(row), middle, mean, stops, failures))
    return Table(
        caption="Results",
        headings=(
            "suite", "cell", "success", "median time", "mean time", "reflex stops", "failures by cause",
        ),
        rows=rows,
        note="Rates with 95 % Wilson intervals, mean simulated times with 95 % bootstrap intervals; * "
        "restricted to the time limit, which an episode of the suite hit. Errors are episodes that could not "
        "be played, and are no failures.",
    )  # fmt: skip


def object_tables(evaluation: Evaluation) -> list[Table]:
    """Successes by object, one table for each suite with several."""
    tables = []
    for suite in evaluation.runs.suites:
        cells, names = evaluation.cells(suite), evaluation.objects(suite)
        if len(names) > 1:
            table = Table(
                caption=f"{suite}: successes by object",
                headings=("object", *(name_of(cell.method) for cell in cells)),
                rows=[
                    (name, *(object_text(evaluation, cell, name, "-") for cell in cells)) for name in names
                ],
            )
            tables.append(table)
    return tables


def object_text(evaluation: Evaluation, cell: Cell | None, name: str, absent: str) -> str:
    """Successes of a cell with one object; another text where it did not meet the object."""
    counts = evaluation.summaries[cell].objects.get(name) if cell else None
    return f"{counts.successes}/{counts.n}" if counts else absent


def refused_meshes_table(runs: Runs) -> Table | None:
    """Meshes that were given and not used; None where there are none."""
    refused = [(mesh.name, mesh.reason) for run in runs.runs for mesh in run.about.objects if mesh.reason]
    caption = f"Meshes that were given and not used: {len(refused)}"
    return Table(caption=caption, headings=("mesh", "why"), rows=refused) if refused else None


def motion_table(evaluation: Evaluation) -> Table:
    """Measures of the motion that the paper argues about: medians over the episodes of each cell."""
    rows = []
    for cell, row in evaluation.summaries.items():
        medians = (f"{row.motion[key]:.3g}" if key in row.motion else "-" for key, _ in _MOTION)
        lowest = "-" if row.worst_singular_value is None else f"{row.worst_singular_value:.3g}"
        rows.append((cell.suite, name_of(cell.method), stops_text(row), lowest, *medians))
    return Table(
        caption="How the arm moved: medians over episodes",
        headings=(
            "suite",
            "cell",
            "reflex stops (singular)",
            "smallest singular value",
            *(h for _, h in _MOTION),
        ),
        rows=rows,
        note="Smallest singular value of the tool's Jacobian (m, rad); - where it was not measured. "
        f"Singular: stops that ended an attempt in which it had fallen below {SINGULARITY:g}.",
    )


@dataclass(frozen=True, kw_only=True)
class TickTimes:
    """Wall-clock of a control tick, by cell and over all cells."""

    table: Table
    not_network: str
    """Share of all but network inference, over the cells with a network; empty where there is none."""


def tick_times(runs: Runs) -> TickTimes | None:
    """Wall-clock of the stages of a control tick; None where no line holds the times of all stages."""
    rows, detect_ms, whole_ms = [], 0.0, 0.0
    for cell, lines in runs.cells.items():
        n, sums = 0, dict.fromkeys(STAGES, 0.0)
        for times in (_stage_times(line.timing) for line in played(lines)):
            if times is not None:
                n, sums = n + 1, {stage: sums[stage] + times[stage] for stage in STAGES}
        if not n:
            continue
        means = {stage: total / n for stage, total in sums.items()}
        tick = sum(means.values())
        network = not runs.owners[cell].reads_truth(cell.detector)
        if network:
            detect_ms, whole_ms = detect_ms + n * means["detect"], whole_ms + n * tick
        share = _share(means["detect"], tick) if network else "no network"
        values = (f"{means[stage]:.1f}" for stage in STAGES)
        rows.append((cell.suite, name_of(cell.method), str(n), f"{tick:.1f}", *values, share))
    if not rows:
        return None
    table = Table(
        caption="Wall-clock of a control tick [ms]",
        headings=("suite", "cell", "n", "tick", *STAGES, "network inference"),
        rows=rows,
        note="Means over n episodes of the median of each stage of a tick of the reach; building scenes, "
        "grasping and lifting are not in it. Network inference is `detect`: the network with what "
        "prepares its image and smooths its maps.",
    )
    return TickTimes(table=table, not_network=_share(whole_ms - detect_ms, whole_ms) if whole_ms else "")


def _stage_times(timing: Mapping[str, float | None]) -> dict[str, float] | None:
    """Times of all stages; None where one of them is not known."""
    times = {stage: ms for stage in STAGES if (ms := timing.get(stage)) is not None}
    return times if len(times) == len(STAGES) else None


def _share(part: float, whole: float) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"
