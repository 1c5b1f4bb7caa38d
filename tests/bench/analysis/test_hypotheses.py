from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bench_runs import stop_row
from msgspec.structs import replace as changed
from toy_runs import lines

from mpgrasp.bench.analysis.hypotheses import Verdict, evaluate
from mpgrasp.bench.analysis.paper import CELLS, CLAIMS, STACKED, Baseline, Claim, Measure, reported
from mpgrasp.bench.record import played
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.outcome import Outcome


def claim(measure: Measure = Measure.SUCCESS) -> Claim:
    return Claim(
        suite="thin", measure=measure, better=("DHRNet", "MP-PC"), worse=("DHRNet", "MVP"), source="here"
    )


@pytest.mark.parametrize(
    ("better", "worse", "verdict"),
    [
        ("1" * 20, "0" * 20, Verdict.CONFIRMED),
        ("0" * 20, "1" * 20, Verdict.CONTRADICTED),
        ("11110" * 4, "01111" * 4, Verdict.NOT_CONFIRMED),
        ("1" * 20, "1" * 16 + "0" * 4, Verdict.NOT_CONFIRMED),
        ("xxxx", "1111", Verdict.ABSENT),
    ],
)
def test_a_claim_is_confirmed_only_by_a_significant_difference(
    better: str, worse: str, verdict: Verdict
) -> None:
    (found,) = evaluate(by_cell([*lines(better), *lines(worse, controller="mvp")]), [claim()])
    assert found.verdict is verdict


def test_p_is_corrected_over_the_claims_that_could_be_tested() -> None:
    cells = by_cell([*lines("1" * 8), *lines("0" * 8, controller="mvp")])
    once = evaluate(cells, [claim()])[0]
    assert once.p == once.p_holm == pytest.approx(2 / 2**8)
    absent = Claim(
        suite="single",
        measure=Measure.SUCCESS,
        better=("DHRNet", "MP-PC"),
        worse=("GG-CNN", "MP-PC"),
        source="",
    )
    both = evaluate(cells, [claim(), absent, claim(Measure.REFLEX)])
    assert both[0].p_holm == pytest.approx(4 / 2**8)
    assert both[1].absent == "suite single absent"


@pytest.mark.parametrize("measure", [Measure.SUCCESS, Measure.TIME])
@pytest.mark.parametrize(
    ("n", "verdict"), [(3, Verdict.UNDECIDABLE), (5, Verdict.UNDECIDABLE), (6, Verdict.CONFIRMED)]
)
def test_a_claim_cannot_be_decided_where_no_outcome_would_be_significant(
    measure: Measure, n: int, verdict: Verdict
) -> None:
    # better in every world: the smallest p there is, 2 / 2^n
    best = [*lines("1" * n, time_limit_s=100.0), *lines("0" * n, controller="mvp", time_limit_s=100.0)]
    (found,) = evaluate(by_cell(best), [claim(measure)])
    assert (found.verdict, found.agrees) == (verdict, True)
    assert found.p == pytest.approx(2 / 2**n)


def test_what_cannot_be_decided_is_no_part_of_the_correction() -> None:
    few = [*lines("111", suite="stacked"), *lines("000", suite="stacked", controller="mvp")]
    cells = by_cell([*lines("1" * 6), *lines("0" * 6, controller="mvp"), *few])
    decided, open_one = evaluate(cells, [claim(), replace(claim(), suite="stacked")])
    assert decided.p_holm == decided.p
    assert decided.verdict is Verdict.CONFIRMED
    assert np.isnan(open_one.p_holm)


def test_times_are_compared_in_pairs_and_whoever_failed_took_the_limit() -> None:
    fast = list(played(lines("1" * 8, time_limit_s=100.0)))
    slow = [
        changed(line, sim_time_s=line.sim_time_s + 1) for line in played(lines("1" * 8, controller="mvp"))
    ]
    (found,) = evaluate(by_cell([*fast, *slow]), [claim(Measure.TIME)])
    assert found.p == pytest.approx(2 / 2**8)  # all eight signs alike
    assert found.verdict is Verdict.CONFIRMED
    assert found.worse - found.better == pytest.approx(1.0)
    gave_up = [changed(line, success=False, outcome=Outcome.TIMEOUT, sim_time_s=1.0) for line in fast]
    (found,) = evaluate(by_cell([*gave_up, *slow]), [claim(Measure.TIME)])
    assert found.better == 100.0
    assert found.verdict is Verdict.CONTRADICTED


def test_reflexes_and_drift_count_less_as_better() -> None:
    stopped = lines("0" * 9, reflex=stop_row(limit="joint_velocity"), blind_drift_m=0.2)
    calm = lines("1" * 9, controller="mvp")
    for found in evaluate(by_cell([*stopped, *calm]), [claim(Measure.REFLEX), claim(Measure.DRIFT)]):
        assert found.verdict is Verdict.CONTRADICTED
    unmeasured = lines("1" * 9, controller="mvp", blind_drift_m=None)
    (found,) = evaluate(by_cell([*stopped, *unmeasured]), [claim(Measure.DRIFT)])
    assert found.verdict is Verdict.ABSENT


def test_each_baseline_is_tested_with_its_own_controllers() -> None:
    published = [*lines("1" * 8), *lines("0" * 8, controller="mvp")]
    robust = [*lines("0" * 8, controller="mppc_robust"), *lines("1" * 8, controller="mvp_robust")]
    cells = by_cell([*published, *robust])
    (found,) = evaluate(cells, [claim()])
    assert found.verdict is Verdict.CONFIRMED
    (found,) = evaluate(cells, [claim()], Baseline.ROBUST)
    assert found.verdict is Verdict.CONTRADICTED
    (found,) = evaluate(by_cell(published), [claim()], Baseline.ROBUST)
    assert found.absent == "DHRNet + MP-PC and DHRNet + MVP absent"


def test_the_correction_is_over_the_claims_of_one_baseline() -> None:
    alone = [*lines("1" * 8), *lines("0" * 8, controller="mvp")]
    robust = [*lines("1" * 8, controller="mppc_robust"), *lines("0" * 8, controller="mvp_robust")]
    for cells in (by_cell(alone), by_cell([*alone, *robust])):
        (found,) = evaluate(cells, [claim()])
        assert found.p_holm == found.p


def test_gg_cnn2_stands_for_gg_cnn_where_that_was_not_played() -> None:
    versus = replace(claim(), better=("DHRNet", "MP-PC"), worse=("GG-CNN", "MP-PC"))
    older = [*lines("1" * 8), *lines("0" * 8, detector="ggcnn2")]
    (found,) = evaluate(by_cell(older), [versus])
    assert (found.verdict, found.worse) == (Verdict.CONFIRMED, 0.0)
    (found,) = evaluate(by_cell([*older, *lines("1" * 8, detector="ggcnn")]), [versus])
    assert (found.verdict, found.worse) == (Verdict.NOT_CONFIRMED, 1.0)


def test_claims_agree_with_the_papers_own_tables() -> None:
    for item in CLAIMS:
        if item.measure is Measure.SUCCESS:
            (k, n), (j, m) = (reported(item.suite)[side] for side in (item.better, item.worse))
            assert k / n > j / m
        elif item.measure is Measure.TIME:
            seconds = dict(zip(CELLS, STACKED, strict=True))
            assert seconds[item.better] < seconds[item.worse]
    assert len(CLAIMS) == len(set(CLAIMS))
    assert reported("unseen")["DHRNet", "MP-PC"] == (36, 40)
    assert reported("mine") == {}
