"""Laws of the engine Ray: whatever dies, the lines are those of one process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_plans import lines_of, make_plan, without_timing

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.playing.crew import make_crew
from mpgrasp.bench.record import ErrorLine, Line
from mpgrasp.exceptions import ConfigError

pytest.importorskip("ray")


def played(
    run_episode: Any, *, hang_after: float | None = 60.0, episodes: int = 4
) -> tuple[list[Line], list[str]]:
    """Lines of two actors in the order of the episodes, and the notes."""
    lines: list[Line] = []
    notes: list[str] = []
    plan = make_plan(episodes=episodes)
    crew = make_crew(plan, 2, run_episode=run_episode, hang_after=hang_after, engine="ray")
    try:
        crew.play(plan.tasks(), lines.append, notes.append)
    finally:
        crew.close()
    return sorted(lines, key=lambda line: line.episode), notes


def test_lines_are_those_of_one_process_and_an_actor_that_dies_once_costs_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPGRASP_TEST_MARK", str(tmp_path / "mark"))
    lines, notes = played(fakes.dies_once)
    assert (tmp_path / "mark").exists()
    assert without_timing(lines) == without_timing(lines_of(make_plan(episodes=4)))
    assert len(notes) == 1
    assert "its actor is gone" in notes[0]


def test_what_breaks_off_or_hangs_is_an_error_row_and_the_rest_goes_on() -> None:
    lines, notes = played(fakes.hangs, hang_after=0.5, episodes=3)
    assert [line.outcome == "error" for line in lines] == [False, True, False]
    assert isinstance(lines[1], ErrorLine)
    assert "hung: no answer within 0.5 s" in lines[1].error
    assert lines[1].traceback.count("attempt") == 2
    assert len(notes) == 1


def test_the_command_line_plays_the_same_run_with_ray(
    tmp_path: Path, fake_world: None, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["thin", "--detector", "fakes:FakeDetector", "--controller", "fakes:FakeController"]
    words += ["--episodes", "3", "--quiet"]
    assert main([*words, "--engine", "ray", "--workers", "1", "--out", str(tmp_path / "a")]) == 0


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"engine": "slurm"}, "unknown engine"),
        ({"address": "auto"}, "without --engine ray"),
        ({"engine": "ray", "workers": 0}, "without workers"),
    ],
)
def test_what_cannot_be_used_is_refused(options: dict[str, Any], reason: str) -> None:
    workers = options.pop("workers", 1)
    with pytest.raises(ConfigError, match=reason):
        make_crew(make_plan(), workers, run_episode=fakes.run_episode, **options)
