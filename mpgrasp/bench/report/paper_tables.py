"""The paper's tables with what the paper reports and what came out here, and the verdicts on its claims."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import mean
from typing import Any

from mpgrasp.bench.analysis.hypotheses import Finding, Verdict, cell_of, count_verdicts
from mpgrasp.bench.analysis.pairing import pair
from mpgrasp.bench.analysis.paper import (
    CELLS,
    SINGLE,
    SINGLE_CONTROLLER,
    STACKED,
    UNSEEN,
    UNSEEN_TRIALS,
    Claim,
    Measure,
    reported,
)
from mpgrasp.bench.report.document import Block, Folded, Paragraph, Table
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.results.runs import Cell, Runs
from mpgrasp.statistics import FEWEST_PAIRS, SIGNIFICANCE, wilson_interval

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

Rows = Mapping[Cell, Mapping[str, Any]]
"""Rows of `summary.summarise` by cell."""
Tests = Sequence[Mapping[str, Any]]
"""Rows of `summary.paired_tests`."""


def paper_tables(runs: Runs, rows: Rows, tests: Tests) -> list[Block]:
    """Tables III to VI, those of suites that were not run in one sentence."""
    blocks: list[Block] = []
    for suite in TITLES:
        if suite not in runs.suites:
            continue
        blocks.append(_rates(suite, runs, rows, tests) if suite != "stacked" else _times(runs, rows))
        if suite == "unseen":
            blocks.append(_toys(runs, rows))
    absent = [title for suite, title in TITLES.items() if suite not in runs.suites]
    if absent:
        blocks.append(
            Paragraph(text=f"Not in this report, since their suites were not run: {'; '.join(absent)}.")
        )
    return blocks


def hypothesis_blocks(findings: Sequence[Finding]) -> list[Block]:
    """How many claims came out how, each with its numbers, and which could not be tested."""
    said = ", ".join(f"{n} {verdict}" for verdict, n in count_verdicts(findings).items() if n)
    tested = [found for found in findings if found.verdict is not Verdict.ABSENT]
    absent = [found for found in findings if found.verdict is Verdict.ABSENT]
    text = f"{len(findings)} orderings that the paper claims of its physical trials: {said}."
    if any(found.verdict is Verdict.UNDECIDABLE for found in findings):
        text += (
            f" Those that cannot be decided were played in so few worlds that p could not fall below "
            f"{SIGNIFICANCE:g}, whatever came out; from {FEWEST_PAIRS} worlds on they could be."
        )
    blocks: list[Block] = [Paragraph(text=text)]
    if tested:
        table = Table(
            caption="The paper's orderings as hypotheses",
            headings=("suite", "claim", "source", "n", "values here", "p", "Holm p", "verdict"),
            rows=[_finding_row(found) for found in tested],
            note=f"Confirmed or contradicted: Holm p < {SIGNIFICANCE:g} in or against the direction claimed. "
            "n: worlds that both met. Rates by McNemar's exact test, times and distances by Wilcoxon's "
            "signed-rank test, two-sided; Holm's correction is over all claims of this table that can be "
            "decided.",
        )
        blocks.append(table)
    if absent:
        rows = [(f.claim.suite, _claim_text(f.claim), f.claim.source, f.absent) for f in absent]
        caption = f"Orderings that could not be tested: {len(absent)}"
        table = Table(caption=caption, headings=("suite", "claim", "source", "why"), rows=rows)
        blocks.append(Folded(summary=caption, blocks=(table,)))
    return blocks


def pair_table(tests: Tests) -> Table:
    """Every two cells of a suite, compared over the worlds that both met."""
    return Table(
        caption="Success in pairs of cells",
        headings=("suite", "A", "B", "n", "both", "A alone", "B alone", "McNemar p", "Holm p"),
        rows=[
            (
                test["suite"], name_of(*test["a"]), name_of(*test["b"]), str(test["n"]), str(test["both"]),
                str(test["a_alone"]), str(test["b_alone"]), f"{test['p']:.3g}", marked(test["p_holm"]),
            )
            for test in tests
        ],
        note=f"* significant: Holm p < {SIGNIFICANCE:g}, corrected over the pairs of a suite.",
    )  # fmt: skip


def rate_text(successes: int, n: int, errors: int = 0) -> str:
    """Successes of n with the rate and its 95 % Wilson interval."""
    if n == 0:
        text = "0/0"
    else:
        low, high = wilson_interval(successes, n)
        text = f"{successes}/{n} = {100 * successes / n:.1f} % [{100 * low:.1f}-{100 * high:.1f}]"
    return text + (f", {errors} errors" if errors else "")


def time_text(row: Mapping[str, Any]) -> str:
    """Mean time of a row of the summary with its bootstrap interval [s]."""
    mean, low, high = (row[f"mean_time_{end}"] for end in ("s", "low", "high"))
    if mean is None or math.isnan(mean):
        return "-"
    return f"{mean:.1f} s" + ("" if low is None or math.isnan(low) else f" [{low:.1f}-{high:.1f}]")


def marked(p: float) -> str:
    """A p, with a star where it is significant."""
    return f"{p:.3g}" + (" *" if p < SIGNIFICANCE else "")


def _rates(suite: str, runs: Runs, rows: Rows, tests: Tests) -> Table:
    paper = reported(suite)
    reference = cell_of(runs.cells, suite, *REFERENCE)
    table: list[tuple[str, ...]] = []
    shown = set()
    for method, counts in paper.items():
        cell = cell_of(runs.cells, suite, *method)
        shown.add(cell)
        here = _here(rows[cell]) if cell else ABSENT
        table.append((_method(method, cell), rate_text(*counts), here, _against(cell, reference, tests)))
    if suite == "single":
        table += [
            (name, rate_text(*SINGLE[name]), "not built here", "-")
            for name in SINGLE
            if (name, SINGLE_CONTROLLER) not in paper
        ]
    table += [
        (name_of(*cell[1:]), "-", _here(rows[cell]), _against(cell, reference, tests))
        for cell in runs.cells
        if cell[0] == suite and cell not in shown
    ]
    note = (
        "95 % Wilson intervals. The last column: p of McNemar's test, corrected after Holm over all pairs of "
        f"cells of the suite, * below {SIGNIFICANCE:g}."
    )
    if suite == "single":
        note += f" The paper does not say by which controller; {SINGLE_CONTROLLER} here."
    against = " + ".join(REFERENCE)
    return Table(
        caption=TITLES[suite],
        headings=("method", "paper", "here", f"against {against}"),
        rows=table,
        note=note,
    )


def _times(runs: Runs, rows: Rows) -> Table:
    reference = cell_of(runs.cells, "stacked", *REFERENCE)
    table: list[tuple[str, ...]] = []
    shown = set()
    for method, seconds in zip(CELLS, STACKED, strict=True):
        cell = cell_of(runs.cells, "stacked", *method)
        shown.add(cell)
        table.append((_method(method, cell), f"{seconds} s", *_time_cells(cell, reference, runs, rows)))
    for cell in runs.cells:
        if cell[0] == "stacked" and cell not in shown:
            table.append((name_of(*cell[1:]), "-", *_time_cells(cell, reference, runs, rows)))
    return Table(
        caption=TITLES["stacked"],
        headings=(
            "method",
            "paper",
            "here",
            "cleared",
            "picks",
            "failed picks",
            "knocked off",
            f"longer than {' + '.join(REFERENCE)}",
        ),
        rows=table,
        note="Simulated seconds: mean, restricted to the time limit where it was hit, with a 95 % bootstrap "
        "interval. Picks, failed ones and objects knocked off the table are means an episode; the last "
        "column is over the worlds that both cleared. The paper gives no number of trials.",
    )


def _time_cells(cell: Cell | None, reference: Cell | None, runs: Runs, rows: Rows) -> tuple[str, ...]:
    if cell is None:
        return ABSENT, *"-----"
    row = rows[cell]
    played = [line for line in runs.cells[cell] if "picks" in line]
    counts = (
        [len(line["picks"]) for line in played],
        [sum(line["failures"].values()) for line in played],
        [len(line["knocked_off"]) for line in played],
    )
    means = (f"{mean(count):.1f}" if count else "-" for count in counts)
    difference = "-"
    if reference and cell != reference:
        found = pair(runs.cells[reference], runs.cells[cell])
        if not math.isnan(found.time_difference_s):
            difference = f"{found.time_difference_s:+.1f} s"
            if not math.isnan(found.time_low):
                difference += f" [{found.time_low:+.1f} to {found.time_high:+.1f}]"
    return time_text(row), rate_text(row["successes"], row["n"], row["errors"]), *means, difference


def _toys(runs: Runs, rows: Rows) -> Table:
    cells = [cell for cell in runs.cells if cell[0] == "unseen"]
    names = list(dict.fromkeys(name for cell in cells for name in rows[cell]["objects"]))
    others = [cell for cell in cells if cell not in {cell_of(runs.cells, "unseen", *m) for m in CELLS}]
    table = [
        (f"paper: {toy}", *(f"{k}/{UNSEEN_TRIALS}" for k in counts), *("-" for _ in others))
        for toy, counts in UNSEEN.items()
    ]
    for name in names:
        columns = [*(cell_of(runs.cells, "unseen", *method) for method in CELLS), *others]
        table.append((f"here: {name}", *(_of_object(cell, name, rows) for cell in columns)))
    return Table(
        caption="Table IV by object",
        headings=("object", *(" + ".join(cell) for cell in CELLS), *(name_of(*cell[1:]) for cell in others)),
        rows=table,
        note="The paper does not say which toys it took: its rows and ours are of different objects.",
    )


def _of_object(cell: Cell | None, name: str, rows: Rows) -> str:
    counts = rows[cell]["objects"].get(name) if cell else None
    return f"{counts['successes']}/{counts['n']}" if counts else ABSENT


def _method(method: tuple[str, str], cell: Cell | None) -> str:
    """The paper's name of a cell, and the name here where that is another."""
    name = " + ".join(method)
    return name if cell is None or name_of(*cell[1:]) == name else f"{name} (here {name_of(*cell[1:])})"


def _here(row: Mapping[str, Any]) -> str:
    return rate_text(row["successes"], row["n"], row["errors"])


def _against(cell: Cell | None, reference: Cell | None, tests: Tests) -> str:
    if cell is None or reference is None:
        return "-"
    if cell == reference:
        return "reference"
    for test in tests:
        if test["suite"] == cell[0] and {tuple(test["a"]), tuple(test["b"])} == {cell[1:], reference[1:]}:
            return f"p = {marked(test['p_holm'])}"
    return "-"


def _finding_row(found: Finding) -> tuple[str, ...]:
    match found.claim.measure:
        case Measure.SUCCESS | Measure.REFLEX:
            values = f"{100 * found.better:.1f} %, {100 * found.worse:.1f} %"
        case Measure.TIME:
            values = f"{found.better:.1f} s, {found.worse:.1f} s"
        case Measure.DRIFT:
            values = f"{found.better:.3f} m, {found.worse:.3f} m"
    return (
        found.claim.suite, _claim_text(found.claim), found.claim.source, str(found.n), values,
        f"{found.p:.3g}", "-" if math.isnan(found.p_holm) else f"{found.p_holm:.3g}", str(found.verdict),
    )  # fmt: skip


def _claim_text(claim: Claim) -> str:
    sign = ">" if claim.measure is Measure.SUCCESS else "<"
    return f"{' + '.join(claim.better)} {sign} {' + '.join(claim.worse)}, {claim.measure}"
