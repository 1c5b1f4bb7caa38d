"""Laws of the report's section on the paper's orderings: both baselines side by side."""

from __future__ import annotations

from toy_runs import lines

from mpgrasp.bench.analysis.hypotheses import evaluate
from mpgrasp.bench.analysis.paper import CLAIMS, Baseline
from mpgrasp.bench.record import Line
from mpgrasp.bench.report.orderings import Orderings, orderings
from mpgrasp.bench.stored_lines import by_cell

PUBLISHED = [*lines("1" * 8), *lines("0" * 8, controller="mvp")]
ROBUST = [*lines("1" * 8, controller="mppc_robust"), *lines("1" * 8, controller="mvp_robust")]
CLAIM = ("thin", "DHRNet + MP-PC > DHRNet + MVP, success rate", "Table V")


def told(episodes: list[Line]) -> Orderings:
    cells = by_cell(episodes)
    return orderings({baseline: evaluate(cells, baseline=baseline) for baseline in Baseline})


def test_a_claim_is_one_row_with_the_verdicts_on_both_baselines() -> None:
    found = told([*PUBLISHED, *ROBUST])
    assert found.n == len(CLAIMS)
    assert found.tested
    (row,) = (dict(zip(found.tested.headings, row, strict=True)) for row in found.tested.rows
              if tuple(row[:3]) == CLAIM)  # fmt: skip
    assert row["values here, published"] == "100.0 %, 0.0 % (n = 8)"
    assert row["verdict, published"] == "confirmed"
    assert row["values here, robust"] == "100.0 %, 100.0 % (n = 8)"
    assert row["verdict, robust"] == "not confirmed"
    published, robust = found.verdicts
    assert published.startswith("Published baseline (MVP and MP-PC): 1 confirmed, ")
    assert robust.startswith("Robust baseline (robust MVP and robust MP-PC): ")
    assert " confirmed" not in robust.replace("not confirmed", "")


def test_a_baseline_that_was_not_played_has_no_columns_and_is_said_to_be_untested() -> None:
    found = told(ROBUST)
    assert found.tested
    assert not [heading for heading in found.tested.headings if "published" in heading]
    assert found.verdicts[0] == f"Published baseline (MVP and MP-PC): {len(CLAIMS)} not tested."
    assert found.absent
    assert {row[3] for row in found.absent.rows} == {"robust"}


def test_without_any_claim_that_was_tested_the_reasons_are_given_once() -> None:
    found = told(lines("111", detector="oracle"))
    assert found.tested is None
    assert found.absent
    assert len(found.absent.rows) == len(CLAIMS)


def test_a_claim_that_was_tested_with_one_baseline_alone_says_so_in_its_row() -> None:
    stacks = [
        *lines("1" * 8, suite="stacked", time_limit_s=100.0),
        *lines("0" * 8, suite="stacked", time_limit_s=100.0, controller="mvp"),
    ]
    found = told([*PUBLISHED, *ROBUST, *stacks])
    assert found.tested
    (row,) = (row for row in found.tested.rows if row[0] == "stacked")
    assert list(row[-4:]) == ["-", "-", "-", "not tested"]
