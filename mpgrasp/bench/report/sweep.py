"""Section of a report on a sweep: its points in a table, and over one or two settings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mpgrasp.bench.analysis.sweep import PointResult, Sweep, point_results
from mpgrasp.bench.record import Cells, Method
from mpgrasp.bench.report.document import Figure, Table
from mpgrasp.bench.report.intervals import counts_text, p_text, rate_text, success_text, time_text
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.sweep_figure import Curve, Interval, sweep_plot
from mpgrasp.bench.results.runs import Runs
from mpgrasp.bench.stored_lines import by_cell


@dataclass(frozen=True, kw_only=True)
class SweepSection:
    """Results of one sweep."""

    points: Table
    by_two_settings: Sequence[Table]
    """A table of success rates for each method; empty unless two settings were varied."""
    figures: Sequence[Figure]
    """Success and time over the values; empty unless one setting was varied, and that in numbers."""


def sweep_sections(runs: Runs) -> list[SweepSection]:
    """The sweeps among some runs of which something was played."""
    sections = []
    for run in runs.runs:
        sweep = run.configuration.sweep
        if sweep is None or not run.lines:
            continue
        rows = point_results(sweep, by_cell(run.lines))
        sections.append(
            SweepSection(
                points=_points(sweep, rows),
                by_two_settings=_crosses(sweep, rows),
                figures=_figures(sweep, rows),
            )
        )
    return sections


def sweep_table(sweep: Sweep, cells: Cells) -> Table:
    """One row for each point and method, with its test against the reference."""
    return _points(sweep, point_results(sweep, cells))


def _points(sweep: Sweep, rows: Sequence[PointResult]) -> Table:
    several = len({row.method for row in rows}) > 1
    return Table(
        caption=f"Sweep of {sweep.suite}: {len(sweep.points)} points",
        headings=(
            *(["cell"] if several else []), *(axis.name for axis in sweep.axes), "success", "mean time",
            "reflex stops", "failures by cause", "alone: reference, point", "McNemar p", "Holm p",
            "point - reference",
        ),
        rows=[
            (
                *([name_of(row.method)] if several else []), *row.point.texts, success_text(row.summary),
                time_text(row.summary), counts_text(row.summary.reflexes) or "0",
                counts_text(row.summary.failures) or "none", *_test(row),
            )
            for row in rows
        ],
        note="The reference has the suite's own values or is the first point where none has them. Each other "
        "point is tested against it over the same worlds: episodes in which one of both alone succeeded, "
        "McNemar's exact test, * significant after Holm's correction over the table, and the difference of "
        "simulated times where both succeeded, with its 95 % interval.",
    )  # fmt: skip


def _test(row: PointResult) -> tuple[str, str, str, str]:
    if row.is_reference:
        return ("reference", "", "", "")
    found = row.pairing
    if found is None:
        return ("-",) * 4
    times = "-"
    if not math.isnan(found.time_difference_s):
        times = f"{found.time_difference_s:+.1f} s"
        if not math.isnan(found.time_low):
            times += f" [{found.time_low:+.1f} to {found.time_high:+.1f}]"
    return f"{found.a_alone}, {found.b_alone}", f"{found.p:.3g}", p_text(row.p_holm), times


def _crosses(sweep: Sweep, rows: Sequence[PointResult]) -> list[Table]:
    if len(sweep.axes) != 2:
        return []
    first, second = sweep.axes
    tables = []
    for method in _methods(rows):
        texts = {
            row.point.texts: rate_text(row.summary.successes, row.summary.n, row.summary.errors)
            for row in rows
            if row.method == method
        }
        tables.append(
            Table(
                caption=f"{sweep.suite}, {name_of(method)}: success by {first.setting} and {second.setting}",
                headings=(first.name, *(f"{second.name} = {text}" for text in second.texts)),
                rows=[
                    (one, *(texts.get((one, other), "-") for other in second.texts)) for one in first.texts
                ],
            )
        )
    return tables


def _figures(sweep: Sweep, rows: Sequence[PointResult]) -> list[Figure]:
    if len(sweep.axes) != 1 or sweep.axes[0].numbers is None:
        return []
    (axis,) = sweep.axes
    place = dict(zip(axis.texts, sweep.axes[0].numbers, strict=True))
    curves, said = [], []
    for method in _methods(rows):
        of_method = [row for row in rows if row.method == method and row.summary.n]
        of_method.sort(key=lambda row: place[row.point.texts[0]])
        curves.append(
            Curve(
                name=name_of(method),
                values=[place[row.point.texts[0]] for row in of_method],
                success=[_success(row) for row in of_method],
                time=[_time(row) for row in of_method],
            )
        )
        rates = (
            f"{row.point.texts[0]}: {success_text(row.summary)}, {time_text(row.summary)}"
            for row in of_method
        )
        said.append(f"{name_of(method)} at {'; '.join(rates)}")
    alt = f"Success and mean time over {axis.setting}, suite {sweep.suite}. {'. '.join(said)}."
    caption = f"{sweep.suite}: success and mean simulated time over {axis.setting}, with 95 % intervals"
    return [Figure(caption=caption, alt=alt, svg=sweep_plot(curves, axis.setting, alt))]


def _methods(rows: Sequence[PointResult]) -> list[Method]:
    return list(dict.fromkeys(row.method for row in rows))


def _success(row: PointResult) -> Interval:
    found = row.summary
    return 100 * (found.rate or 0.0), 100 * found.wilson_low, 100 * found.wilson_high


def _time(row: PointResult) -> Interval:
    found = (row.summary.mean_time_s, row.summary.mean_time_low, row.summary.mean_time_high)
    middle = math.nan if found[0] is None else found[0]
    low, high = (middle if bound is None else bound for bound in found[1:])
    return middle, low, high
