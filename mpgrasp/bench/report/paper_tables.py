"""The paper's Tables III, IV, V and VI: what the paper reports beside what came out here.

Tables III (`single`), IV (`unseen`) and V (`thin`) are success rates, made by `success_table`; Table IV by
object is `unseen_object_table`; Table VI (`stacked`), the time to clear the table, is `clearing_time_table`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mpgrasp.bench.analysis.pairing import pair
from mpgrasp.bench.analysis.paper import (
    CELLS,
    SINGLE_CONTROLLER,
    STACKED,
    UNSEEN,
    UNSEEN_TRIALS,
    reported,
)
from mpgrasp.bench.record import Cell
from mpgrasp.bench.report.document import Table
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.intervals import p_text, rate_text, success_text, time_text
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.tables import object_text
from mpgrasp.statistics import SIGNIFICANCE

ABSENT = "not run"
REFERENCE = ("DHRNet", "MP-PC")
"""The paper's method, against which the others are marked."""
TITLES = {
    "single": "Table III: one household object",
    "unseen": "Table IV: unseen toys",
    "thin": "Table V: thin objects",
    "stacked": "Table VI: time to clear the table",
}
"""The paper's tables by suite."""


@dataclass(frozen=True, kw_only=True)
class PaperTables:
    """Tables III to VI, as far as their suites were run."""

    tables: list[Table]
    absent: list[str]
    """Titles of those whose suites were not run."""


def paper_tables(evaluation: Evaluation) -> PaperTables:
    """Tables III to VI of some runs."""
    tables = []
    for suite in (suite for suite in TITLES if suite in evaluation.runs.suites):
        if suite == "stacked":
            tables.append(clearing_time_table(evaluation))
        else:
            tables.append(success_table(evaluation, suite))
        if suite == "unseen":
            tables.append(unseen_object_table(evaluation))
    absent = [title for suite, title in TITLES.items() if suite not in evaluation.runs.suites]
    return PaperTables(tables=tables, absent=absent)


def success_table(evaluation: Evaluation, suite: str) -> Table:
    """Table III, IV or V: success rates of the paper's methods, then those of other cells of the suite."""
    paper = reported(suite)
    reference = evaluation.paper_cell(suite, REFERENCE)
    rows = []
    for method, cell in _methods(evaluation, suite, list(paper)):
        here = success_text(evaluation.summaries[cell]) if cell else ABSENT
        against = _against(cell, reference, evaluation)
        rows.append((_method_text(method, cell), rate_text(*paper[method]), here, against))
    for cell in _other_cells(evaluation, suite, list(paper)):
        here, against = success_text(evaluation.summaries[cell]), _against(cell, reference, evaluation)
        rows.append((name_of(cell.method), "-", here, against))
    note = (
        "95 % Wilson intervals. The last column: p of McNemar's test, corrected after Holm over all pairs of "
        f"cells of the suite, * below {SIGNIFICANCE:g}."
    )
    if suite == "single":
        note += f" The paper does not say by which controller; {SINGLE_CONTROLLER} here."
    return Table(
        caption=TITLES[suite],
        headings=("method", "paper", "here", f"against {' + '.join(REFERENCE)}"),
        rows=rows,
        note=note,
    )


def unseen_object_table(evaluation: Evaluation) -> Table:
    """Table IV by object: the paper's toys, then the objects here."""
    others = _other_cells(evaluation, "unseen", CELLS)
    columns = [*(cell for _, cell in _methods(evaluation, "unseen", CELLS)), *others]
    rows = [
        (f"paper: {toy}", *(f"{k}/{UNSEEN_TRIALS}" for k in counts), *("-" for _ in others))
        for toy, counts in UNSEEN.items()
    ]
    for name in evaluation.objects("unseen"):
        counts = (object_text(evaluation, cell, name, ABSENT) for cell in columns)
        rows.append((f"here: {name}", *counts))
    return Table(
        caption="Table IV by object",
        headings=(
            "object",
            *(" + ".join(cell) for cell in CELLS),
            *(name_of(cell.method) for cell in others),
        ),
        rows=rows,
        note="The paper does not say which toys it took: its rows and ours are of different objects.",
    )


def clearing_time_table(evaluation: Evaluation) -> Table:
    """Table VI: time until the table was clear."""
    reference = evaluation.paper_cell("stacked", REFERENCE)
    seconds = dict(zip(CELLS, STACKED, strict=True))
    rows = [
        (_method_text(method, cell), f"{seconds[method]} s", *_clearing_texts(cell, reference, evaluation))
        for method, cell in _methods(evaluation, "stacked", CELLS)
    ]
    for cell in _other_cells(evaluation, "stacked", CELLS):
        rows.append((name_of(cell.method), "-", *_clearing_texts(cell, reference, evaluation)))
    return Table(
        caption=TITLES["stacked"],
        headings=(
            "method", "paper", "here", "cleared", "picks", "failed picks", "knocked off",
            f"longer than {' + '.join(REFERENCE)}",
        ),
        rows=rows,
        note="Simulated seconds: mean, restricted to the time limit where it was hit, with a 95 % bootstrap "
        "interval. Picks, failed ones and objects knocked off the table are means an episode; the last "
        "column is over the worlds that both cleared. The paper gives no number of trials.",
    )  # fmt: skip


def _methods(
    evaluation: Evaluation, suite: str, methods: Sequence[tuple[str, str]]
) -> Iterator[tuple[tuple[str, str], Cell | None]]:
    """Methods of the paper with the cells that stand for them."""
    return ((method, evaluation.paper_cell(suite, method)) for method in methods)


def _other_cells(evaluation: Evaluation, suite: str, methods: Sequence[tuple[str, str]]) -> list[Cell]:
    """Cells of a suite that stand for none of these methods."""
    shown = {cell for _, cell in _methods(evaluation, suite, methods)}
    return [cell for cell in evaluation.cells(suite) if cell not in shown]


def _method_text(method: tuple[str, str], cell: Cell | None) -> str:
    """The paper's name of a method, and the name here where that is another."""
    name = " + ".join(method)
    return name if cell is None or name_of(cell.method) == name else f"{name} (here {name_of(cell.method)})"


def _against(cell: Cell | None, reference: Cell | None, evaluation: Evaluation) -> str:
    if cell is None or reference is None:
        return "-"
    if cell == reference:
        return "reference"
    for test in evaluation.tests:
        if test.suite == cell.suite and {test.a, test.b} == {cell.method, reference.method}:
            return f"p = {p_text(test.p_holm)}"
    return "-"


def _clearing_texts(cell: Cell | None, reference: Cell | None, evaluation: Evaluation) -> tuple[str, ...]:
    """Cells of a row of Table VI from "here" on."""
    if cell is None:
        return ABSENT, *"-----"
    row, lines = evaluation.summaries[cell], evaluation.runs.cells
    cleared = row.clearing
    counts = (cleared.attempts, sum(cleared.failed_attempts.values()), cleared.knocked_off) if cleared else ()
    means = [f"{count / row.n:.1f}" for count in counts] or ["-"] * 3
    longer = "-"
    if reference and cell != reference:
        found = pair(lines[reference], lines[cell])
        if not math.isnan(found.time_difference_s):
            longer = f"{found.time_difference_s:+.1f} s"
            if not math.isnan(found.time_low):
                longer += f" [{found.time_low:+.1f} to {found.time_high:+.1f}]"
    return time_text(row), success_text(row), *means, longer
