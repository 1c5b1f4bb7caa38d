"""Runs with the statistics that the parts of a report draw on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mpgrasp.bench.analysis.hypotheses import cell_of
from mpgrasp.bench.analysis.summary import CellSummary, PairedTest, paired_tests, summarise
from mpgrasp.bench.record import Cell
from mpgrasp.bench.results.runs import Runs


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """Runs, a summary of each of their cells, and tests between them."""

    runs: Runs
    summaries: Mapping[Cell, CellSummary]
    tests: Sequence[PairedTest]
    """One for every two cells of a suite."""

    @classmethod
    def of(cls, runs: Runs) -> Evaluation:
        """Evaluate some runs."""
        summaries = {summary.cell: summary for summary in summarise(runs.cells)}
        return cls(runs=runs, summaries=summaries, tests=paired_tests(runs.cells))

    def cells(self, suite: str) -> list[Cell]:
        """Cells of a suite, in order of first appearance."""
        return [cell for cell in self.runs.cells if cell.suite == suite]

    def objects(self, suite: str) -> list[str]:
        """Names of the objects that cells of a suite met, in order of first appearance."""
        return list(
            dict.fromkeys(name for cell in self.cells(suite) for name in self.summaries[cell].objects)
        )

    def paper_cell(self, suite: str, method: tuple[str, str]) -> Cell | None:
        """The cell that stands for (detector, controller) of the paper; None if there is none."""
        return cell_of(self.runs.cells, suite, method)
