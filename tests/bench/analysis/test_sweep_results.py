"""Laws of the results of a sweep."""

from __future__ import annotations

from math import comb

import pytest
from bench_runs import error_row, grasp_row

from mpgrasp.bench.analysis.sweep import Sweep, SweepPoint, SweptSetting, point_results
from mpgrasp.bench.record import Line, line_of
from mpgrasp.bench.stored_lines import by_cell

POINTS = ("s[gamma=0]", "s[gamma=1]", "s[gamma=2]")
SWEEP = Sweep(
    suite="s",
    axes=(SweptSetting(setting="controller.gamma", name="gamma", texts=("0", "1", "2"), values=(0, 1, 2)),),
    points=tuple(SweepPoint(suite=name, texts=(str(k),)) for k, name in enumerate(POINTS)),
    references={"d/c": POINTS[1], "d/e": POINTS[0]},
)


def lines(suite: str, pattern: str, controller: str = "c") -> list[Line]:
    which = {"suite": suite, "controller": controller}
    return [
        line_of(
            error_row(episode=k, scene_seed=k, **which)
            if letter == "x"
            else grasp_row(episode=k, scene_seed=k, success=letter == "1", **which)
        )
        for k, letter in enumerate(pattern)
    ]


def test_each_point_is_tested_against_the_reference_over_the_same_worlds() -> None:
    played = [*lines(POINTS[0], "00000000"), *lines(POINTS[1], "11111110"), *lines(POINTS[2], "11111111")]
    first, reference, last = point_results(SWEEP, by_cell(played))
    assert reference.is_reference
    assert reference.pairing is None
    assert first.pairing is not None
    assert last.pairing is not None
    assert (first.pairing.n, first.pairing.a_alone, first.pairing.b_alone) == (8, 7, 0)
    assert (last.pairing.a_alone, last.pairing.b_alone) == (0, 1)
    p = 2 * comb(7, 0) / 2**7  # all seven discordant pairs on one side
    assert first.pairing.p == pytest.approx(p)
    assert first.p_holm == pytest.approx(2 * p)  # two tests
    assert last.p_holm == 1.0


def test_methods_have_references_of_their_own_and_stand_together() -> None:
    played = [line for name in POINTS[:2] for c in "ce" for line in lines(name, "1", c)]
    rows = point_results(SWEEP, by_cell(played))
    assert [(row.method.controller, row.point.suite, row.is_reference) for row in rows] == [
        ("c", POINTS[0], False), ("c", POINTS[1], True), ("e", POINTS[0], True), ("e", POINTS[1], False),
    ]  # fmt: skip


def test_without_the_reference_nothing_is_tested_and_errors_are_no_worlds() -> None:
    (row,) = point_results(SWEEP, by_cell(lines(POINTS[0], "1")))
    assert (row.pairing, row.is_reference) == (None, False)
    rows = point_results(SWEEP, by_cell([*lines(POINTS[1], "1"), *lines(POINTS[2], "x")]))
    assert [row.pairing for row in rows] == [None, None]
    assert rows[1].summary.errors == 1


def test_words_and_switches_are_no_numbers() -> None:
    for values in (("grid", "pool"), (True, False), (None, 1.0)):
        axis = SweptSetting(setting="controller.choice", name="choice", texts=("a", "b"), values=values)
        assert axis.numbers is None
    assert SWEEP.axes[0].numbers == [0.0, 1.0, 2.0]
