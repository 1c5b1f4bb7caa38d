"""Laws of the stopwatch: every second belongs to one stage of one part."""

from __future__ import annotations

import pytest

from mpgrasp.bench.profiling.stopwatch import Entry, Stopwatch


class Clock:
    """A clock that somebody else turns."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_stage_does_not_count_the_stages_inside_of_it() -> None:
    clock = Clock()
    watch = Stopwatch(clock)
    with watch.stage("outer"):
        clock.now += 1.0
        for _ in range(3):
            with watch.stage("inner"):
                clock.now += 10.0
                with watch.stage("innermost"):
                    clock.now += 100.0
        clock.now += 0.5
    assert {entry.stage: seconds for entry, seconds in watch.seconds.items()} == {
        "outer": 1.5,
        "inner": 30.0,
        "innermost": 300.0,
    }
    assert watch.calls[Entry("", "inner")] == 3
    assert watch.total() == clock.now


def test_a_stage_counts_to_the_part_in_which_it_began() -> None:
    clock = Clock()
    watch = Stopwatch(clock)
    with watch.during("first"):
        with watch.stage("work"):
            clock.now += 1.0
            with watch.during("second"), watch.stage("work"):
                clock.now += 2.0
        with watch.stage("work"):
            clock.now += 4.0
    assert watch.seconds == {Entry("first", "work"): 5.0, Entry("second", "work"): 2.0}
    assert watch.total(part="second") == 2.0
    assert watch.total(stage="work") == 7.0
    assert watch.part == ""


def test_what_a_stage_took_before_an_error_counts() -> None:
    clock = Clock()
    watch = Stopwatch(clock)

    def fail() -> None:
        with watch.stage("outer"), watch.stage("inner"):
            clock.now += 3.0
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert watch.total(stage="inner") == 3.0
    assert watch.total(stage="outer") == 0.0
