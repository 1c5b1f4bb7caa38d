"""The paper's orderings as hypotheses: tested in pairs over common worlds, and a verdict for each.

Rates (success, reflex stops) by McNemar's exact test, times and distances by Wilcoxon's signed-rank test;
all two-sided, and corrected after Holm over all that could be decided. A claim over too few worlds for any p
below the level of significance is no test, and left out (Tarone, Biometrics 46, 1990).

The claims are about MVP and MP-PC. They are tested for each baseline on its own, the correction included:
with the controllers as published, and with this project's robust ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from mpgrasp.bench.analysis.pairing import pair_worlds
from mpgrasp.bench.analysis.paper import CLAIMS, CONTROLLERS, METHODS, QUOTED, Baseline, Claim, Measure
from mpgrasp.bench.analysis.summary import time_limits
from mpgrasp.bench.analysis.tally import restricted_time
from mpgrasp.bench.record import Cell, Cells, PlayedLine
from mpgrasp.statistics import FEWEST_PAIRS, SIGNIFICANCE, holm, mcnemar, wilcoxon


class Verdict(StrEnum):
    """Result of the test of a claim."""

    CONFIRMED = "confirmed"
    """Significant, in the direction that the paper claims."""
    NOT_CONFIRMED = "not confirmed"
    CONTRADICTED = "contradicted"
    """Significant, in the other direction."""
    UNDECIDABLE = "cannot be decided"
    """The worlds are so few that nothing could be significant, whatever came out."""
    ABSENT = "not tested"
    """Cells or measurements are absent."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A claim, and the result of its test on these runs."""

    claim: Claim
    verdict: Verdict
    n: int = 0
    """Worlds that both cells met, with the measurement in both."""
    better: float = np.nan
    """Mean of the cell that is claimed to be better: a rate (0 to 1), seconds or metres."""
    worse: float = np.nan
    p: float = np.nan
    p_holm: float = np.nan
    """NaN where the claim cannot be decided."""
    absent: str = ""
    """Missing cells or measurements, in words."""
    agrees: bool = False
    """True if the difference has the direction claimed, significant or not."""


def cell_of(
    cells: Cells, suite: str, method: tuple[str, str], baseline: Baseline = Baseline.PUBLISHED
) -> Cell | None:
    """The cell of a run that stands for the paper's (detector, controller); None if there is none.

    One detector stands for a method throughout a suite: the first of its names that occurs there.
    """
    there = {cell.detector for cell in cells if cell.suite == suite}
    for detector in {**METHODS, **QUOTED}[method[0]]:
        if detector in there:
            cell = Cell(suite, detector, CONTROLLERS[baseline][method[1]])
            return cell if cell in cells else None
    return None


def evaluate(
    cells: Cells, claims: Sequence[Claim] = CLAIMS, baseline: Baseline = Baseline.PUBLISHED
) -> list[Finding]:
    """One finding per claim, in their order, with the controllers of a baseline."""
    suites = {claim.suite for claim in claims}
    limits = time_limits({cell: lines for cell, lines in cells.items() if cell.suite in suites})
    findings = [_test(claim, cells, limits, baseline) for claim in claims]
    tested = [k for k, f in enumerate(findings) if f.verdict not in (Verdict.ABSENT, Verdict.UNDECIDABLE)]
    for k, p in zip(tested, holm([findings[k].p for k in tested]), strict=True):
        found, verdict = findings[k], Verdict.NOT_CONFIRMED
        if p < SIGNIFICANCE:
            verdict = Verdict.CONFIRMED if found.agrees else Verdict.CONTRADICTED
        findings[k] = replace(found, p_holm=p, verdict=verdict)
    return findings


def _test(claim: Claim, cells: Cells, limits: Mapping[str, float | None], baseline: Baseline) -> Finding:
    keys = [cell_of(cells, claim.suite, side, baseline) for side in (claim.better, claim.worse)]
    missing = [
        " + ".join(side) for side, key in zip((claim.better, claim.worse), keys, strict=True) if key is None
    ]
    if missing:
        suite_there = any(cell.suite == claim.suite for cell in cells)
        text = " and ".join(missing) if suite_there else f"suite {claim.suite}"
        return Finding(claim=claim, verdict=Verdict.ABSENT, absent=f"{text} absent")
    limit = limits[claim.suite]
    sides = [cells[key] for key in keys if key]
    values = [
        (_value(one, claim.measure, limit), _value(other, claim.measure, limit))
        for one, other in pair_worlds(*sides)
    ]
    pairs = [both for both in values if None not in both]
    if not pairs:
        return Finding(claim=claim, verdict=Verdict.ABSENT, absent="no common episode with this measurement")
    better, worse = np.array(pairs, float).T
    higher = claim.measure is Measure.SUCCESS
    gain = better - worse if higher else worse - better
    if claim.measure in (Measure.SUCCESS, Measure.REFLEX):
        p, agrees = mcnemar(int(np.sum(gain > 0)), int(np.sum(gain < 0))), gain.sum() > 0
    else:
        p, agrees = wilcoxon(gain)
    return Finding(
        claim=claim,
        verdict=Verdict.UNDECIDABLE if len(pairs) < FEWEST_PAIRS else Verdict.NOT_CONFIRMED,
        n=len(pairs),
        better=float(better.mean()),
        worse=float(worse.mean()),
        p=p,
        agrees=bool(agrees),
    )


def _value(line: PlayedLine, measure: Measure, limit: float | None) -> float | None:
    """Value of an episode that a claim compares; None where it was not measured."""
    match measure:
        case Measure.SUCCESS:
            return line.success
        case Measure.REFLEX:
            return line.reflex is not None
        case Measure.TIME:
            return restricted_time(line, limit)
        case Measure.DRIFT:
            return line.blind_drift_m


def count_verdicts(findings: Iterable[Finding]) -> dict[Verdict, int]:
    """Number of findings by verdict, all verdicts included."""
    found = [finding.verdict for finding in findings]
    return {verdict: found.count(verdict) for verdict in Verdict}
