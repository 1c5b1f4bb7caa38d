"""Laws of the engine Ray: whatever dies, the lines are those of one process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_plans import lines_of, make_plan, without_timing

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.playing.crew import check_engine, make_crew
from mpgrasp.bench.record import ErrorLine, Line
from mpgrasp.bench.results.reader import read_lines
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


def test_the_command_line_plays_the_same_run_with_ray(tmp_path: Path, fake_world: pytest.MonkeyPatch) -> None:
    words = ["thin", "--detector", "fakes:FakeDetector", "--controller", "fakes:FakeController"]
    words += ["--episodes", "3", "--quiet"]
    runs = {}
    for engine, workers in (("ray", 2), ("processes", 0)):
        out = tmp_path / engine
        assert main([*words, "--engine", engine, "--workers", str(workers), "--out", str(out)]) == 0
        runs[engine] = without_timing(list(read_lines(out).lines))
    assert runs["ray"] == runs["processes"]
    assert len(runs["ray"]) == 3


@pytest.mark.parametrize(
    ("engine", "workers", "address", "reason"),
    [
        ("slurm", 1, None, "unknown engine"),
        ("processes", 1, "auto", "--address without --engine ray"),
        ("ray", 0, None, "without workers"),
        ("ray", 1, "127.0.0.1:1", "no Ray there"),
        ("ray", 1, "ray://127.0.0.1:1", "no Ray there"),
        ("ray", 1, "127.0.0.1:99999999", "no Ray there"),
    ],
)
def test_what_cannot_be_used_is_refused(engine: str, workers: int, address: str | None, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        check_engine(engine, workers, address)


def test_a_name_that_no_cluster_has_is_refused_before_a_folder_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["thin", "--engine", "ray", "--address", "127.0.0.1:1", "--workers", "1"]
    assert main([*command, "--out", str(tmp_path / "run")]) == 2
    assert "no Ray there" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_no_more_actors_are_started_than_there_are_episodes() -> None:
    plan = make_plan(episodes=1)
    crew = make_crew(plan, 2, run_episode=fakes.run_episode, engine="ray")
    try:
        crew.play(plan.tasks(), lambda line: None, lambda text: None)
        assert len(crew._hosts) == 1  # type: ignore[attr-defined]
    finally:
        crew.close()
