"""The paper's orderings with the verdicts on them, by baseline, and the paired tests between cells."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from mpgrasp.bench.analysis.hypotheses import Finding, Verdict, count_verdicts
from mpgrasp.bench.analysis.paper import Baseline, Claim, Measure, controllers_of
from mpgrasp.bench.analysis.summary import PairedTest
from mpgrasp.bench.report.document import Table
from mpgrasp.bench.report.intervals import p_text
from mpgrasp.bench.report.names import name_of, name_of_player
from mpgrasp.statistics import FEWEST_PAIRS, SIGNIFICANCE

Findings = Mapping[Baseline, Sequence[Finding]]
"""Findings on the same claims, in the same order, by baseline."""

_HEADINGS = ("values here", "p", "Holm p", "verdict")  # of a baseline's columns


@dataclass(frozen=True, kw_only=True)
class Orderings:
    """Verdicts on the orderings that the paper claims, for both baselines side by side."""

    n: int
    verdicts: Sequence[str]
    """For each baseline, what it is and the numbers of orderings by verdict, in a sentence."""
    undecidable: str
    """Why some of them cannot be decided; empty where all can."""
    tested: Table | None
    absent: Table | None
    """Those that could not be tested with a baseline that was played."""


def orderings(findings: Findings) -> Orderings:
    """Verdicts, each with its numbers, and the orderings that could not be tested."""
    undecidable = ""
    if any(found.verdict is Verdict.UNDECIDABLE for found in chain(*findings.values())):
        undecidable = (
            "Those that cannot be decided were played in so few worlds that p could not fall below "
            f"{SIGNIFICANCE:g}, whatever came out; from {FEWEST_PAIRS} worlds on they could be."
        )
    tested = {baseline: some for baseline, some in findings.items() if any(map(_is_tested, some))}
    return Orderings(
        n=len(next(iter(findings.values()))),
        verdicts=[_verdict_text(baseline, some) for baseline, some in findings.items()],
        undecidable=undecidable,
        tested=_tested_table(tested) if tested else None,
        # where nothing was tested, the reasons are those of the paper's own baseline
        absent=_absent_table(tested or {Baseline.PUBLISHED: findings[Baseline.PUBLISHED]}),
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


def _is_tested(found: Finding) -> bool:
    return found.verdict is not Verdict.ABSENT


def _verdict_text(baseline: Baseline, findings: Sequence[Finding]) -> str:
    names = " and ".join(name_of_player(name) for name in controllers_of(baseline))
    counts = ", ".join(f"{n} {verdict}" for verdict, n in count_verdicts(findings).items() if n)
    return f"{baseline.capitalize()} baseline ({names}): {counts}."


def _tested_table(tested: Findings) -> Table:
    """One row for each claim that was tested with any baseline."""
    both = list(zip(*tested.values(), strict=True))
    return Table(
        caption="The paper's orderings as hypotheses",
        headings=(
            "suite", "claim", "source",
            *(f"{head}, {baseline}" for baseline in tested for head in _HEADINGS),
        ),
        rows=[
            (
                found[0].claim.suite, _claim_text(found[0].claim), found[0].claim.source,
                *chain.from_iterable(map(_finding_texts, found)),
            )
            for found in both if any(map(_is_tested, found))
        ],
        note=f"Confirmed or contradicted: Holm p < {SIGNIFICANCE:g} in or against the direction claimed. "
        "n: worlds that both met. Rates by McNemar's exact test, times and distances by Wilcoxon's "
        "signed-rank test, two-sided; Holm's correction is over all claims of this table that can be "
        "decided with the same baseline.",
    )  # fmt: skip


def _finding_texts(found: Finding) -> tuple[str, str, str, str]:
    """Values, p, Holm p and verdict, as in `_HEADINGS`."""
    if not _is_tested(found):
        return "-", "-", "-", str(found.verdict)
    p_holm = "-" if math.isnan(found.p_holm) else f"{found.p_holm:.3g}"
    return f"{_values(found)} (n = {found.n})", f"{found.p:.3g}", p_holm, str(found.verdict)


def _absent_table(findings: Findings) -> Table | None:
    absent = [
        (found.claim.suite, _claim_text(found.claim), found.claim.source, str(baseline), found.absent)
        for baseline, some in findings.items()
        for found in some
        if not _is_tested(found)
    ]
    if not absent:
        return None
    return Table(
        caption=f"Orderings that could not be tested: {len(absent)}",
        headings=("suite", "claim", "source", "baseline", "why"),
        rows=absent,
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
