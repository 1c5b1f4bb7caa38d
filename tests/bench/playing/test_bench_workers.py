from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_plans import lines_of, make_plan, play, without_timing

from mpgrasp.bench.playing import workers
from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import EpisodeError
from mpgrasp.bench.record import ErrorLine, Line
from mpgrasp.suite import TRIALS, load_suite

CRASHES = {
    1: ("ended with exit code 9", "no traceback"),
    2: ("was killed by SIGKILL", "no traceback"),
    3: ("was killed by SIGSEGV", "in crashes"),
}


def played(
    run_episode: Any, *, hang_after: float | None = 60.0, count: int = 1, episodes: int = 3
) -> tuple[list[Line], list[str]]:
    """Lines in the order of the episodes, and the notes."""
    lines: list[Line] = []
    notes: list[str] = []
    plan = make_plan(episodes=episodes)
    play(plan, lines.append, workers=count, run_episode=run_episode, hang_after=hang_after, note=notes.append)
    return sorted(lines, key=lambda line: line.episode), notes


def broken(line: Line) -> ErrorLine:
    assert isinstance(line, ErrorLine)
    return line


def test_a_crash_costs_one_retry_and_then_its_episode_alone() -> None:
    lines, notes = played(fakes.crashes, count=2, episodes=5)
    assert [line.outcome == "error" for line in lines] == [False, True, True, True, False]
    for episode, (how, trace) in CRASHES.items():
        line = broken(lines[episode])
        assert line.success is None
        assert how in line.error
        assert line.traceback.count("attempt") == 2
        assert trace in line.traceback
        (note,) = [text for text in notes if f"episode {episode} " in text]
        assert "played again" in note
    undisturbed = lines_of(make_plan(episodes=5))
    assert without_timing([lines[0], lines[4]]) == without_timing([undisturbed[0], undisturbed[4]])


def test_a_hang_ends_after_its_time_and_shows_where_it_was() -> None:
    clock = time.monotonic()
    lines, _ = played(fakes.hangs, hang_after=0.3, count=2)
    assert time.monotonic() - clock < 300  # of 3600; starting workers takes long on a busy machine
    assert [line.outcome == "error" for line in lines] == [False, True, False]
    assert "hung: no answer within 0.3 s" in broken(lines[1]).error
    assert "in hangs" in broken(lines[1]).traceback


def test_a_worker_that_lets_go_of_its_pipe_and_lives_on_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "END_LIMIT", 0.2)
    lines, _ = played(fakes.lets_go)
    assert [line.outcome == "error" for line in lines] == [False, True, False]
    assert "closed its pipe and went on" in broken(lines[1]).error  # in the end it would say: exit code 0


def test_every_trial_has_its_own_time_after_which_it_is_taken_for_hung(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert set(workers.HANG_AFTER) == set(TRIALS)
    monkeypatch.setattr(workers, "HANG_AFTER", {"grasp": 0.3, "clear": 1e9})
    lines, _ = played(fakes.hangs, hang_after=None)
    assert [line.outcome == "error" for line in lines] == [False, True, False]
    assert "hung: no answer within 0.3 s" in broken(lines[1]).error
    suite = load_suite("stacked")
    plan = Plan(suites=(suite,), methods=make_plan().methods)
    pool = workers.WorkerPool(plan, 1, fakes.run_episode, hang_after=None, attempts=1)
    assert pool._limit(next(plan.tasks())) == 1e9


def test_an_episode_that_succeeds_at_the_second_attempt_is_as_if_nothing_had_happened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPGRASP_TEST_MARK", str(tmp_path / "mark"))
    lines, notes = played(fakes.dies_once)
    assert without_timing(lines) == without_timing(lines_of(make_plan(episodes=3)))
    assert len(notes) == 1


@pytest.mark.parametrize("count", [0, 1])
def test_an_exception_is_an_error_row_with_its_traceback(count: int) -> None:
    lines, notes = played(fakes.breaks_off, count=count)
    assert [line.outcome == "error" for line in lines] == [False, True, True]
    assert "ZeroDivisionError: a bug in a detector" in broken(lines[1]).error
    assert "fakes.py" in broken(lines[1]).traceback
    assert len(notes) == 2


def test_workers_that_cannot_start_end_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "_work", fakes.ends_at_once)
    with pytest.raises(EpisodeError, match=r"die while they start.*exit code 3"):
        played(fakes.run_episode)
