"""The paper's orderings with the verdicts on them, and the paired tests between cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mpgrasp.bench.analysis.hypotheses import Finding, Verdict, count_verdicts
from mpgrasp.bench.analysis.paper import Claim, Measure
from mpgrasp.bench.analysis.summary import PairedTest
from mpgrasp.bench.report.document import Table
from mpgrasp.bench.report.intervals import p_text
from mpgrasp.bench.report.names import name_of
from mpgrasp.statistics import FEWEST_PAIRS, SIGNIFICANCE


@dataclass(frozen=True, kw_only=True)
class Orderings:
    """Verdicts on the orderings that the paper claims."""

    n: int
    verdicts: str
    """Numbers of orderings by verdict."""
    undecidable: str
    """Why some of them cannot be decided; empty where all can."""
    tested: Table | None
    absent: Table | None
    """Those that could not be tested."""


def orderings(findings: Sequence[Finding]) -> Orderings:
    """Verdicts, each with its numbers, and the orderings that could not be tested."""
    undecidable = ""
    if any(found.verdict is Verdict.UNDECIDABLE for found in findings):
        undecidable = (
            "Those that cannot be decided were played in so few worlds that p could not fall below "
            f"{SIGNIFICANCE:g}, whatever came out; from {FEWEST_PAIRS} worlds on they could be."
        )
    tested = [found for found in findings if found.verdict is not Verdict.ABSENT]
    absent = [found for found in findings if found.verdict is Verdict.ABSENT]
    return Orderings(
        n=len(findings),
        verdicts=", ".join(f"{n} {verdict}" for verdict, n in count_verdicts(findings).items() if n),
        undecidable=undecidable,
        tested=_tested_table(tested) if tested else None,
        absent=_absent_table(absent) if absent else None,
    )


def pair_table(tests: Sequence[PairedTest]) -> Table | None:
    """Every two cells of a suite, compared over the worlds that both met; None where there are none."""
    if not tests:
        return None
    return Table(
        caption="Success in pairs of cells",
        headings=("suite", "A", "B", "n", "both", "A alone", "B alone", "McNemar p", "Holm p"),
        rows=[
            (
                test.suite, name_of(test.a), name_of(test.b), str(test.n), str(test.both),
                str(test.a_alone), str(test.b_alone), f"{test.p:.3g}", p_text(test.p_holm),
            )
            for test in tests
        ],
        note=f"* significant: Holm p < {SIGNIFICANCE:g}, corrected over the pairs of a suite.",
    )  # fmt: skip


def _tested_table(tested: Sequence[Finding]) -> Table:
    return Table(
        caption="The paper's orderings as hypotheses",
        headings=("suite", "claim", "source", "n", "values here", "p", "Holm p", "verdict"),
        rows=[
            (
                found.claim.suite, _claim_text(found.claim), found.claim.source, str(found.n),
                _values(found), f"{found.p:.3g}",
                "-" if math.isnan(found.p_holm) else f"{found.p_holm:.3g}", str(found.verdict),
            )
            for found in tested
        ],
        note=f"Confirmed or contradicted: Holm p < {SIGNIFICANCE:g} in or against the direction claimed. "
        "n: worlds that both met. Rates by McNemar's exact test, times and distances by Wilcoxon's "
        "signed-rank test, two-sided; Holm's correction is over all claims of this table that can be "
        "decided.",
    )  # fmt: skip


def _absent_table(absent: Sequence[Finding]) -> Table:
    return Table(
        caption=f"Orderings that could not be tested: {len(absent)}",
        headings=("suite", "claim", "source", "why"),
        rows=[(f.claim.suite, _claim_text(f.claim), f.claim.source, f.absent) for f in absent],
    )


def _values(found: Finding) -> str:
    match found.claim.measure:
        case Measure.SUCCESS | Measure.REFLEX:
            return f"{100 * found.better:.1f} %, {100 * found.worse:.1f} %"
        case Measure.TIME:
            return f"{found.better:.1f} s, {found.worse:.1f} s"
        case Measure.DRIFT:
            return f"{found.better:.3f} m, {found.worse:.3f} m"


def _claim_text(claim: Claim) -> str:
    sign = ">" if claim.measure is Measure.SUCCESS else "<"
    return f"{' + '.join(claim.better)} {sign} {' + '.join(claim.worse)}, {claim.measure}"
