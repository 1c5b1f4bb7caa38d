"""Summary of a set of episodes: one row per cell, and a paired test for every two cells of a suite."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import combinations
from statistics import median

import msgspec

from mpgrasp.bench.analysis.pairing import pair
from mpgrasp.bench.record import (
    Cell,
    Cells,
    ClearingLine,
    Line,
    Method,
    PlayedLine,
    Reach,
    Record,
    by_cell,
    played,
)
from mpgrasp.episode.result import MOTION
from mpgrasp.outcome import Outcome
from mpgrasp.statistics import holm, mean_interval, median_interval, restricted, wilson_interval

SINGULARITY = 0.05
"""Smallest singular value of the tool Jacobian (m, rad) below which a stop counts as one of a singularity.

At 0.1 m/s the worst direction then asks a joint for 0.1 / 0.05 = 2 rad/s of the 2.175 that it may have. In
the runs that were published when this was chosen, 5 of 6,497 attempts without a stop came below it (59 below
0.07), and 42 of 143 with one, all stopped by the velocity or acceleration of joint 3, 4 or 5.
"""


class ObjectCounts(Record, frozen=True, kw_only=True):
    """Grasps of one object."""

    n: int
    successes: int


class ClearingCounts(Record, frozen=True, kw_only=True):
    """Attempts and objects, added up over all episodes in which a table was to be cleared."""

    attempts: int
    failed_attempts: dict[str, int]
    """Attempts that put nothing into the basket, by outcome."""
    in_basket: int
    knocked_off: int
    left: int


class CellSummary(Record, frozen=True, kw_only=True, omit_defaults=True):
    """Summary of the episodes of one cell."""

    suite: str
    detector: str
    controller: str
    n: int
    """Episodes that were played; error rows do not count."""
    errors: int
    successes: int
    rate: float | None
    """Success rate [0, 1]; None where nothing was played."""
    wilson_low: float
    wilson_high: float
    median_time_s: float | None
    """Median of the simulated times [s]; it and the values below are None where there are too few times."""
    median_time_low: float | None
    median_time_high: float | None
    mean_time_s: float | None
    """Mean of the simulated times, restricted to `time_limit_s` where that is given [s]."""
    mean_time_low: float | None
    mean_time_high: float | None
    time_limit_s: float | None
    """Time at which episodes of the suite were broken off [s]; None where none hit the limit."""
    reflex_stops: int
    reflexes: dict[str, int]
    """Protective stops by the limit that was broken."""
    singularities: int | None = None
    """Attempts that were stopped after a singular value below `SINGULARITY`; None where none was measured,
    and in summaries that were written before they were counted."""
    failures: dict[str, int]
    """Failed episodes by outcome."""
    objects: dict[str, ObjectCounts]
    """Grasps by object."""
    motion: dict[str, float]
    """Medians of `MOTION`, of those that were measured."""
    worst_singular_value: float | None
    clearing: ClearingCounts | None
    """None where no table was to be cleared."""

    @property
    def cell(self) -> Cell:
        """The cell whose episodes these are."""
        return Cell(self.suite, self.detector, self.controller)


class PairedTest(Record, frozen=True, kw_only=True):
    """Two cells of a suite over the worlds that both met."""

    suite: str
    a: Method
    b: Method
    n: int
    both: int
    """Worlds in which both succeeded."""
    a_alone: int
    b_alone: int
    p: float
    """Two-sided p of McNemar's exact test."""
    p_holm: float
    """The same after Holm's correction over all tests of the suite."""


class RunSummary(Record, frozen=True, kw_only=True):
    """Content of summary.json."""

    complete: bool
    """False while episodes are missing or could not be played."""
    cells: tuple[CellSummary, ...]
    paired_tests: tuple[PairedTest, ...]


def summarise(lines: Iterable[Line]) -> list[CellSummary]:
    """One row per cell (suite, detector, controller), in order of first appearance."""
    cells = by_cell(lines)
    limits = time_limits(cells)
    return [_summary(cell, of_cell, limits[cell.suite]) for cell, of_cell in cells.items()]


def time_limits(cells: Cells) -> dict[str, float | None]:
    """Time at which an episode of each suite was broken off [s]; None where none hit its limit.

    Tables that were not cleared, for whatever reason, count as hits of the limit that their lines give.
    """
    limits: dict[str, float | None] = {cell.suite: None for cell in cells}
    for cell, lines in cells.items():
        for line in played(lines):
            hit = line.time_limit_s if isinstance(line, ClearingLine) and not line.success else None
            if hit is None and line.outcome is Outcome.TIMEOUT:
                hit = line.sim_time_s
            before = limits[cell.suite]
            if hit is not None:
                limits[cell.suite] = hit if before is None else min(before, hit)
    return limits


def restricted_time(line: PlayedLine, limit: float | None = None) -> float:
    """Simulated time of an episode cut off at its limit, or else at `limit` [s].

    Who has not got to the end took at least as long as is allowed.
    """
    allowed = line.time_limit_s if isinstance(line, ClearingLine) else limit
    if allowed is None:
        return line.sim_time_s
    return min(line.sim_time_s, allowed) if line.success else allowed


def _summary(cell: Cell, of_cell: Sequence[Line], limit: float | None) -> CellSummary:
    lines = played(of_cell)
    n, successes = len(lines), sum(line.success for line in lines)
    low, high = wilson_interval(successes, n)
    times = [restricted_time(line) for line in lines]
    middle, middle_low, middle_high = median_interval(times)
    mean, mean_low, mean_high = mean_interval(restricted(times, limit))
    values = {key: [value for line in lines if (value := getattr(line, key)) is not None] for key in MOTION}
    stops = Counter(stop.limit for line in lines for stop in line.all_stops)
    failures = Counter(line.outcome.value for line in lines if not line.success)
    return CellSummary(
        **cell._asdict(),
        n=n,
        errors=len(of_cell) - n,
        successes=successes,
        rate=successes / n if n else None,
        wilson_low=low,
        wilson_high=high,
        median_time_s=_known(middle),
        median_time_low=_known(middle_low),
        median_time_high=_known(middle_high),
        mean_time_s=_known(mean),
        mean_time_low=_known(mean_low),
        mean_time_high=_known(mean_high),
        time_limit_s=limit,
        reflex_stops=stops.total(),
        reflexes=dict(sorted(stops.items())),
        singularities=_singularities(lines),
        failures=dict(sorted(failures.items())),
        objects=_by_object(lines),
        motion={key: median(numbers) for key, numbers in values.items() if numbers},
        worst_singular_value=min(values["min_singular_value"], default=None),
        clearing=_clearing([line for line in lines if isinstance(line, ClearingLine)]),
    )


def _singularities(lines: Sequence[PlayedLine]) -> int | None:
    """Number of attempts that a stop ended in a singular posture; None where nothing was measured."""
    attempts: list[Reach] = []
    for line in lines:
        attempts += line.picks if isinstance(line, ClearingLine) else [line]
    lowest = [
        (attempt.min_singular_value, attempt.reflex)
        for attempt in attempts
        if attempt.min_singular_value is not None
    ]
    return sum(value < SINGULARITY and stop is not None for value, stop in lowest) if lowest else None


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _by_object(lines: Sequence[PlayedLine]) -> dict[str, ObjectCounts]:
    endings: dict[str, list[bool]] = {}
    for line in lines:
        endings.setdefault(line.object, []).append(line.success)
    return {name: ObjectCounts(n=len(ends), successes=sum(ends)) for name, ends in sorted(endings.items())}


def _clearing(lines: Sequence[ClearingLine]) -> ClearingCounts | None:
    if not lines:
        return None
    outcomes = Counter(pick.outcome for line in lines for pick in line.picks)
    return ClearingCounts(
        attempts=outcomes.total(),
        failed_attempts={
            outcome.value: count for outcome, count in sorted(outcomes.items()) if outcome != Outcome.SUCCESS
        },
        in_basket=sum(len(line.in_basket) for line in lines),
        knocked_off=sum(len(line.knocked_off) for line in lines),
        left=sum(len(line.left) for line in lines),
    )


def paired_tests(lines: Iterable[Line]) -> list[PairedTest]:
    """One row per two cells of a suite over the worlds that both met."""
    rows: list[PairedTest] = []
    for (cell_a, lines_a), (cell_b, lines_b) in combinations(by_cell(lines).items(), 2):
        if cell_a.suite != cell_b.suite:
            continue
        found = pair(lines_a, lines_b)
        rows.append(
            PairedTest(
                suite=cell_a.suite,
                a=cell_a.method,
                b=cell_b.method,
                n=found.n,
                both=found.both,
                a_alone=found.a_alone,
                b_alone=found.b_alone,
                p=found.p,
                p_holm=found.p,
            )
        )
    return _corrected(rows)


def _corrected(rows: Sequence[PairedTest]) -> list[PairedTest]:
    """The rows with Holm's correction over those of a suite."""
    corrected: dict[int, float] = {}
    for suite in {row.suite for row in rows}:
        family = [k for k, row in enumerate(rows) if row.suite == suite]
        corrected.update(zip(family, holm([rows[k].p for k in family]), strict=True))
    return [msgspec.structs.replace(row, p_holm=corrected[k]) for k, row in enumerate(rows)]
