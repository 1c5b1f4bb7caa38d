"""Ranks methods of several runs in each suite: who is significantly better counts, not the rate alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mpgrasp.bench.analysis.summary import CellSummary, PairedTest
from mpgrasp.bench.record import Cell
from mpgrasp.statistics import SIGNIFICANCE


@dataclass(frozen=True, kw_only=True)
class Rank:
    """One method in a suite."""

    rank: int
    """1 and the number of methods that are significantly better: several may share a rank."""
    summary: CellSummary


def ranks(suite: str, summaries: Mapping[Cell, CellSummary], tests: Sequence[PairedTest]) -> list[Rank]:
    """Return the methods of a suite, the best first.

    Args:
        suite: whose methods are ranked.
        summaries: of all cells.
        tests: McNemar's tests of every two of them, over the worlds that both met.
    """
    better: dict[Cell, int] = {cell: 0 for cell in summaries if cell.suite == suite}
    for test in tests:
        if test.suite == suite and test.p_holm < SIGNIFICANCE:
            loser = test.b if test.a_alone > test.b_alone else test.a
            better[Cell(suite, *loser)] += 1
    ranked = [Rank(rank=1 + count, summary=summaries[cell]) for cell, count in better.items()]
    return sorted(ranked, key=lambda row: (row.rank, -(row.summary.rate or 0), str(row.summary.cell)))
