"""Laws of the summary of a set of episodes, and of the paired tests between its cells."""

from __future__ import annotations

from typing import Any

import pytest
from bench_runs import clearing_row, error_row, grasp_row, pick_row, stop_row

from mpgrasp.bench.analysis.summary import CellSummary, ObjectCounts, paired_tests, summarise
from mpgrasp.bench.analysis.tally import SINGULARITY
from mpgrasp.bench.record import Line, line_of, record_of
from mpgrasp.bench.report.intervals import stops_text
from mpgrasp.motion.trajectory import MotionConfig


def line(success: bool = True, outcome: str | None = None, **other: Any) -> Line:
    how = {} if outcome is None else {"outcome": outcome}
    return line_of(grasp_row(**{"sim_time_s": 1.0, "success": success, **how, **other}))


def test_cells_are_kept_apart_and_in_order() -> None:
    cells = summarise(
        [line(detector="b"), line(detector="a"), line(detector="b", success=False, outcome="missed")]
    )
    assert [(c.detector, c.n, c.successes) for c in cells] == [("b", 2, 1), ("a", 1, 1)]


def test_failures_are_counted_by_cause_and_add_up() -> None:
    lines = [
        line(),
        line(False, "missed"),
        line(False, "reflex", reflex=stop_row(limit="velocity")),
        line(False, "missed"),
    ]
    (cell,) = summarise(lines)
    assert cell.failures == {"missed": 2, "reflex": 1}
    assert cell.reflex_stops == 1
    assert cell.n == cell.successes + sum(cell.failures.values())


def test_time_is_the_median_and_objects_are_counted_apart() -> None:
    lines = [line(sim_time_s=t, object=o) for t, o in [(1.0, "x"), (9.0, "y"), (2.0, "x"), (4.0, "x")]]
    (cell,) = summarise(lines)
    assert cell.median_time_s == 3.0
    assert cell.objects == {"x": ObjectCounts(n=3, successes=3), "y": ObjectCounts(n=1, successes=1)}


def test_no_episodes_no_cells() -> None:
    assert summarise([]) == []


def test_errors_are_counted_apart_from_failures() -> None:
    (cell,) = summarise([line(), line_of(error_row(episode=1))])
    assert (cell.n, cell.errors, cell.successes, cell.failures) == (1, 1, 1, {})


def test_a_cell_of_errors_alone_has_no_rate() -> None:
    (cell,) = summarise([line_of(error_row())])
    assert (cell.n, cell.errors, cell.rate, cell.median_time_s) == (0, 1, None, None)
    assert (cell.wilson_low, cell.wilson_high) == (0.0, 1.0)


def test_where_the_limit_was_hit_the_mean_time_of_every_cell_of_the_suite_is_restricted_to_it() -> None:
    lines = [
        line(sim_time_s=4.0),
        line(False, "timeout", sim_time_s=10.0),
        line(controller="x", sim_time_s=12.0),
        line(suite="t", sim_time_s=30.0),
    ]
    limited, cut, other = summarise(lines)
    assert (limited.mean_time_s, limited.time_limit_s) == (7.0, 10.0)
    assert (cut.mean_time_s, cut.time_limit_s) == (10.0, 10.0)
    assert (other.mean_time_s, other.time_limit_s) == (30.0, None)


def test_the_way_of_the_arm_is_given_by_medians_and_the_worst_singular_value() -> None:
    (cell,) = summarise(
        [line(min_singular_value=s, first_detection_s=t) for s, t in [(0.2, 1.0), (0.1, None)]]
    )
    assert cell.motion == {"min_singular_value": pytest.approx(0.15), "first_detection_s": 1.0}
    assert cell.worst_singular_value == 0.1


def test_reflex_stops_are_counted_by_their_cause() -> None:
    stops = [line(False, "reflex", reflex=stop_row(limit=limit)) for limit in ("b", "a", "b")]
    assert summarise(stops)[0].reflexes == {"a": 1, "b": 2}


def test_a_stop_is_one_of_a_singularity_below_the_level_that_counts_as_near_one() -> None:
    assert MotionConfig().singularity_warning == SINGULARITY
    stopped = [
        line(False, "reflex", reflex=stop_row(), min_singular_value=value)
        for value in (0.008, 0.049, 0.05, None)
    ]
    (cell,) = summarise([*stopped, line(min_singular_value=0.01)])
    assert (cell.reflex_stops, cell.singularities) == (4, 2)
    assert stops_text(cell) == "4 (2)"


def test_singularities_of_a_clearing_are_those_of_its_attempts() -> None:
    stop = stop_row()
    picks = [
        pick_row(success=False, outcome="reflex", reflex=stop, min_singular_value=0.01),
        pick_row(success=False, outcome="reflex", reflex=stop, min_singular_value=0.2),
        pick_row(min_singular_value=0.01),
    ]
    table = line_of(clearing_row(picks=picks, stops=[stop] * 3, reflex=stop, min_singular_value=0.01))
    (cell,) = summarise([table])
    assert (cell.reflex_stops, cell.singularities) == (3, 1)


def test_singularities_that_nobody_measured_are_not_in_the_row_and_a_row_without_them_is_read() -> None:
    (cell,) = summarise([line(False, "reflex", reflex=stop_row())])
    assert cell.singularities is None
    row = cell.as_row()
    assert "singularities" not in row
    assert record_of(CellSummary, row).as_row() == row
    assert stops_text(cell) == "1"


def test_every_two_cells_of_a_suite_are_tested_over_common_worlds() -> None:
    lines = [
        line(success, episode=k, scene_seed=k, controller=controller, suite=suite)
        for suite in ("s", "t")
        for controller, successes in (("a", 8), ("b", 0), ("c", 8))
        for k, success in enumerate([True] * successes + [False] * (8 - successes))
    ]
    tests = paired_tests(lines)
    assert [(t.suite, t.a, t.b) for t in tests] == [
        (suite, ("d", x), ("d", y)) for suite in ("s", "t") for x, y in ("ab", "ac", "bc")
    ]
    assert [t.p for t in tests[:3]] == [pytest.approx(2 / 2**8), 1.0, pytest.approx(2 / 2**8)]
    # a family per suite, of three tests, and not one of all six
    assert [t.p_holm for t in tests] == [pytest.approx(min(1.0, 3 * t.p)) for t in tests]
