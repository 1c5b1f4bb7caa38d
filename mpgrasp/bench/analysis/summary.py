"""Summary of a set of episodes: one row per cell, and a paired test for every two cells of a suite."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from statistics import median

import msgspec

from mpgrasp.bench.analysis.endings import Endings
from mpgrasp.bench.analysis.pairing import pair
from mpgrasp.bench.analysis.tally import Tally, limit_hit
from mpgrasp.bench.record import Cell, Cells, Line, Method, Record, played
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.outcome import Outcome
from mpgrasp.statistics import holm, mean_interval, median_interval, restricted, wilson_interval


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


def summarise(lines: Iterable[Line] | Cells) -> list[CellSummary]:
    """One row per cell (suite, detector, controller), in order of first appearance."""
    cells = lines if isinstance(lines, Mapping) else by_cell(lines)
    tallies = {cell: Tally(of_cell) for cell, of_cell in cells.items()}
    limits = _by_suite({cell: tally.limit for cell, tally in tallies.items()})
    return [_summary(cell, tally, limits[cell.suite]) for cell, tally in tallies.items()]


def time_limits(cells: Cells) -> dict[str, float | None]:
    """Time at which an episode of each suite was broken off [s]; None where none hit its limit."""
    hits = {cell: filter(None, map(limit_hit, played(lines))) for cell, lines in cells.items()}
    return _by_suite({cell: min(found, default=None) for cell, found in hits.items()})


def _by_suite(limits: Mapping[Cell, float | None]) -> dict[str, float | None]:
    """The least limit of the cells of each suite."""
    least: dict[str, float | None] = {}
    for cell, limit in limits.items():
        least[cell.suite] = min(filter(None, (least.get(cell.suite), limit)), default=None)
    return least


def _summary(cell: Cell, tally: Tally, limit: float | None) -> CellSummary:
    low, high = wilson_interval(tally.successes, tally.n)
    middle, middle_low, middle_high = median_interval(tally.times)
    mean, mean_low, mean_high = mean_interval(restricted(tally.times, limit))
    return CellSummary(
        **cell._asdict(),
        n=tally.n,
        errors=tally.errors,
        successes=tally.successes,
        rate=tally.successes / tally.n if tally.n else None,
        wilson_low=low,
        wilson_high=high,
        median_time_s=_known(middle),
        median_time_low=_known(middle_low),
        median_time_high=_known(middle_high),
        mean_time_s=_known(mean),
        mean_time_low=_known(mean_low),
        mean_time_high=_known(mean_high),
        time_limit_s=limit,
        reflex_stops=tally.stops.total(),
        reflexes=dict(sorted(tally.stops.items())),
        singularities=tally.singular,
        failures=dict(sorted(tally.failures.items())),
        objects={
            name: ObjectCounts(n=n, successes=successes)
            for name, (n, successes) in sorted(tally.objects.items())
        },
        motion={key: median(numbers) for key, numbers in tally.motion.items() if numbers},
        worst_singular_value=min(tally.motion["min_singular_value"], default=None),
        clearing=_clearing(tally) if tally.clearings else None,
    )


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _clearing(tally: Tally) -> ClearingCounts:
    failed = {outcome.value: n for outcome, n in sorted(tally.attempts.items()) if outcome != Outcome.SUCCESS}
    return ClearingCounts(
        attempts=tally.attempts.total(),
        failed_attempts=failed,
        in_basket=tally.in_basket,
        knocked_off=tally.knocked_off,
        left=tally.left,
    )


def paired_tests(lines: Iterable[Line] | Cells) -> list[PairedTest]:
    """One row per two cells of a suite over the worlds that both met."""
    cells = lines if isinstance(lines, Mapping) else by_cell(lines)
    suites = Counter(cell.suite for cell in cells)
    endings = {cell: Endings.of(lines) for cell, lines in cells.items() if suites[cell.suite] > 1}
    rows: list[PairedTest] = []
    for (cell_a, endings_a), (cell_b, endings_b) in combinations(endings.items(), 2):
        if cell_a.suite != cell_b.suite:
            continue
        found = pair(endings_a, endings_b)
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
