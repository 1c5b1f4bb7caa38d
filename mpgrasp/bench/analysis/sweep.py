"""Sweeps: the points of a grid of settings, each beside the one with the suite's own values."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from mpgrasp.bench.analysis.pairing import Pairing, pair
from mpgrasp.bench.analysis.summary import CellSummary, summarise
from mpgrasp.bench.record import Cell, Cells, Method, Record
from mpgrasp.statistics import holm


class SweptSetting(Record, frozen=True, kw_only=True):
    """A setting that a sweep varies: an axis of its grid."""

    setting: str
    """Its group and its keys, with dots between them."""
    name: str
    """Its name in the names of the points."""
    texts: tuple[str, ...]
    """Its values as they were written."""
    values: tuple[Any, ...]

    @property
    def numbers(self) -> list[float] | None:
        """Values as numbers; None where one of them is none."""
        numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values)
        return [float(value) for value in self.values] if numeric else None


class SweepPoint(Record, frozen=True, kw_only=True):
    """A combination of values, played as a suite of its own over the worlds of the suite that is swept."""

    suite: str
    """Name, with the point in brackets."""
    texts: tuple[str, ...]
    """A value of each axis, as it was written."""


class Sweep(Record, frozen=True, kw_only=True):
    """Grid of a sweep."""

    suite: str
    """Name of the suite that is swept."""
    axes: tuple[SweptSetting, ...]
    points: tuple[SweepPoint, ...]
    references: dict[str, str]
    """Suite that each method (DETECTOR/CONTROLLER) is tested against: the point at which it has the settings
    of the suite that is swept, or else the first one."""


@dataclass(frozen=True, kw_only=True)
class PointResult:
    """Results of a method at a point."""

    point: SweepPoint
    method: Method
    summary: CellSummary
    pairing: Pairing | None
    """The reference (A) and this point (B) over the same worlds; None for the reference itself, and where
    they have no world in common."""
    is_reference: bool
    p_holm: float = math.nan
    """p of McNemar's exact test after Holm's correction over all tests of the sweep; NaN without a test."""


def point_results(sweep: Sweep, cells: Cells) -> list[PointResult]:
    """Return the results of every point that was played, method by method."""
    summaries = {row.cell: row for row in summarise(cells)}
    methods = dict.fromkeys(cell.method for cell in cells)
    rows = []
    for method in methods:
        reference = Cell(sweep.references[str(method)], *method)
        for point in sweep.points:
            cell = Cell(point.suite, *method)
            if cell not in cells:
                continue
            tested = cell != reference and reference in cells
            pairing = pair(cells[reference], cells[cell]) if tested else None
            rows.append(
                PointResult(
                    point=point,
                    method=method,
                    summary=summaries[cell],
                    pairing=pairing if pairing and pairing.n else None,
                    is_reference=cell == reference,
                )
            )
    corrected = iter(holm([row.pairing.p for row in rows if row.pairing]))
    return [replace(row, p_holm=next(corrected)) if row.pairing else row for row in rows]
