"""Section of a report on a ladder: one picture, the levels at which methods fail, and pairs of methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpgrasp.bench.analysis.ladder import RATES, Climb, Comparison, LadderCard, beyond, climbs, comparisons
from mpgrasp.bench.record import Cells
from mpgrasp.bench.report.document import Figure, Table
from mpgrasp.bench.report.intervals import p_text
from mpgrasp.bench.report.ladder_figure import Ascended, ladder_plot
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.results.runs import Runs
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.statistics import SIGNIFICANCE, wilson_interval
from mpgrasp.thresholds import Scale, Threshold

_POINTS = 120
"""Points of a drawn curve."""


@dataclass(frozen=True, kw_only=True)
class LadderSection:
    """Results of one ladder."""

    verdict: str
    """What came out, in sentences."""
    figure: Figure
    thresholds: Table
    rungs: Table
    pairs: Table | None
    """Every pair of methods; None with one method."""


def ladder_sections(runs: Runs) -> list[LadderSection]:
    """The ladders among some runs of which something was played."""
    return [
        ladder_section(run.configuration.ladder, by_cell(run.lines))
        for run in runs.runs
        if run.configuration.ladder is not None and run.lines
    ]


def ladder_section(card: LadderCard, cells: Cells) -> LadderSection:
    """The section on one ladder."""
    found = climbs(card, cells)
    pairs = comparisons(card.scale, found)
    return LadderSection(
        verdict=verdict(card, found, pairs),
        figure=_figure(card, found),
        thresholds=threshold_table(card, found),
        rungs=_rungs(card, found),
        pairs=_pairs(card, pairs) if pairs else None,
    )


def threshold_table(card: LadderCard, found: Sequence[Climb]) -> Table:
    """One row for each method, the one that gets furthest first."""
    return Table(
        caption=f"{card.title}: {card.scalar} [{card.unit}] at which success falls",
        headings=("cell", *(f"to {100 * rate:.0f} %" for rate in RATES), "episodes"),
        rows=[
            (
                name_of(climb.method),
                *(level_text(card.scale, threshold) for threshold in climb.thresholds),
                str(climb.episodes),
            )
            for climb in ranked(card.scale, found)
        ],
        note="Level with its 95 % interval. < or >: beyond the last rung. "
        f"Rungs: {', '.join(f'{rung:g}' for rung in card.rungs)}.",
    )


def ranked(scale: Scale, found: Sequence[Climb]) -> list[Climb]:
    """Methods by the level of their last rate, the one that gets furthest first."""
    return sorted(found, key=lambda climb: float(scale.ease([climb.thresholds[-1].level])[0]))


def level_text(scale: Scale, threshold: Threshold) -> str:
    """A level and its interval: "1.4 (1.3-1.5)", or "< 0.7" beyond the ladder."""
    side = beyond(scale, threshold.level)
    if side:
        end = scale.level(float(scale.rungs[0 if side == "harder" else -1]))
        return f"{'<' if threshold.level < end else '>'} {end:g}"
    low, high = (_bound(scale, bound) for bound in (threshold.low, threshold.high))
    return f"{threshold.level:.3g} ({low}-{high})"


def _bound(scale: Scale, bound: float) -> str:
    """A bound of an interval, marked where it lies beyond the ladder."""
    if not beyond(scale, bound):
        return f"{bound:.3g}"
    first, last = scale.levels[0], scale.levels[-1]
    return f"<{first:g}" if bound < first else f">{last:g}"


def verdict(card: LadderCard, found: Sequence[Climb], pairs: Sequence[Comparison]) -> str:
    """What came out, in sentences."""
    best = ranked(card.scale, found)
    said = [
        f"{name_of(climb.method)} succeeds in half of the episodes down to "
        f"{level_text(card.scale, climb.thresholds[-1])} {card.unit}"
        if card.harder == "lower"
        else f"{name_of(climb.method)} succeeds in half of the episodes up to "
        f"{level_text(card.scale, climb.thresholds[-1])} {card.unit}"
        for climb in best
    ]
    text = "; ".join(said) + "."
    apart = sum(row.p_holm < SIGNIFICANCE for row in pairs)
    if pairs:
        text += f" {apart} of {len(pairs)} differences, at 90 and at 50 %, are significant."
    return text


def _rungs(card: LadderCard, found: Sequence[Climb]) -> Table:
    """Successes of the episodes at each rung."""

    def cell(climb: Climb, rung: float) -> str:
        results = climb.results.get(rung, {})
        return f"{sum(results.values())} of {len(results)}" if results else "-"

    return Table(
        caption=f"{card.name}: successes by {card.scalar} [{card.unit}]",
        headings=("cell", *(f"{rung:g}" for rung in card.rungs)),
        rows=[
            (name_of(climb.method), *(cell(climb, rung) for rung in card.rungs))
            for climb in ranked(card.scale, found)
        ],
    )


def _pairs(card: LadderCard, pairs: Sequence[Comparison]) -> Table:
    sign = "quotient" if card.logarithmic else "difference"
    return Table(
        caption=f"{card.name}: every two methods over the same worlds",
        headings=("A", "B", "rate", f"{sign} of levels, A and B", "p", "Holm p"),
        rows=[
            (
                name_of(row.first),
                name_of(row.second),
                f"{100 * row.rate:.0f} %",
                f"{row.found.ratio:.3g} ({row.found.low:.3g} to {row.found.high:.3g})",
                f"{row.found.p:.2g}",
                p_text(row.p_holm),
            )
            for row in pairs
        ],
        note="Worlds are resampled, the same for both; levels beyond the ladder count as its end. "
        "* significant after Holm's correction over the pairs at that rate.",
    )


def _figure(card: LadderCard, found: Sequence[Climb]) -> Figure:
    ends = card.rungs[0], card.rungs[-1]
    levels = np.geomspace(*ends, _POINTS) if card.logarithmic else np.linspace(*ends, _POINTS)
    drawn = []
    for climb in ranked(card.scale, found):
        rate, low, high = climb.fit.rates(levels)
        rungs = sorted(rung for rung, results in climb.results.items() if results)
        tallies = [(sum(of.values()), len(of)) for of in (climb.results[rung] for rung in rungs)]
        drawn.append(
            Ascended(
                name=name_of(climb.method),
                levels=levels,
                rate=100 * rate,
                low=100 * low,
                high=100 * high,
                rungs=rungs,
                rates=[100 * k / n for k, n in tallies],
                intervals=[(100 * a, 100 * b) for a, b in (wilson_interval(k, n) for k, n in tallies)],
                numbers=[n for _, n in tallies],
            )
        )
    said = []
    for of in drawn:
        rates = (f"{rate:.0f} % at {rung:g}" for rung, rate in zip(of.rungs, of.rates, strict=True))
        said.append(f"{of.name}: {', '.join(rates)}")
    axis = f"{card.scalar} [{card.unit}]"
    alt = f"Success over {axis}. {'; '.join(said)}."
    caption = f"{card.title}: curves with their 95 % intervals, larger dots for more episodes"
    return Figure(
        caption=caption,
        alt=alt,
        svg=ladder_plot(drawn, axis, alt, logarithmic=card.logarithmic, falling=card.harder == "lower"),
    )
