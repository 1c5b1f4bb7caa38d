from __future__ import annotations

import math
from typing import Any

import pytest

from mpgrasp.bench.statistics import summarise, wilson_interval
from mpgrasp.exceptions import ConfigError


def line(success: bool = True, outcome: str = "success", **other: Any) -> dict[str, Any]:
    common = {"suite": "s", "detector": "d", "controller": "c", "object": "o", "sim_time_s": 1.0}
    return {**common, "reflex": None, "success": success, "outcome": outcome, **other}


@pytest.mark.parametrize(("successes", "n"), [(0, 10), (10, 10), (7, 10), (60, 100), (1, 3)])
def test_wilson_bounds_lie_where_the_score_test_just_rejects(successes: int, n: int) -> None:
    # independent of scipy: at a bound p, |rate - p| equals z standard errors under p
    z = 1.959963984540054
    for p in wilson_interval(successes, n):
        if 0 < p < 1:
            assert abs(successes / n - p) == pytest.approx(z * math.sqrt(p * (1 - p) / n), rel=1e-6)


def test_wilson_interval_holds_the_rate_and_stays_within_zero_and_one() -> None:
    for n in (1, 5, 40):
        for successes in range(n + 1):
            low, high = wilson_interval(successes, n)
            assert 0 <= low <= successes / n <= high <= 1


def test_nothing_tried_says_nothing() -> None:
    assert wilson_interval(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(("successes", "n"), [(3, 2), (-1, 2)])
def test_impossible_counts_are_refused(successes: int, n: int) -> None:
    with pytest.raises(ConfigError):
        wilson_interval(successes, n)


def test_cells_are_kept_apart_and_in_order() -> None:
    cells = summarise(
        [line(detector="b"), line(detector="a"), line(detector="b", success=False, outcome="missed")]
    )
    assert [(c["detector"], c["n"], c["successes"]) for c in cells] == [("b", 2, 1), ("a", 1, 1)]


def test_failures_are_counted_by_cause_and_add_up() -> None:
    lines = [
        line(),
        line(False, "missed"),
        line(False, "reflex", reflex={"limit": "velocity"}),
        line(False, "missed"),
    ]
    (cell,) = summarise(lines)
    assert cell["failures"] == {"missed": 2, "reflex": 1}
    assert cell["reflex_stops"] == 1
    assert cell["n"] == cell["successes"] + sum(cell["failures"].values())


def test_time_is_the_median_and_objects_are_counted_apart() -> None:
    lines = [line(sim_time_s=t, object=o) for t, o in [(1.0, "x"), (9.0, "y"), (2.0, "x"), (4.0, "x")]]
    (cell,) = summarise(lines)
    assert cell["median_time_s"] == 3.0
    assert cell["objects"] == {"x": {"n": 3, "successes": 3}, "y": {"n": 1, "successes": 1}}


def test_no_episodes_no_cells() -> None:
    assert summarise([]) == []
