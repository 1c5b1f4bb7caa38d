from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import fakes
import numpy as np
import pytest
from bench_plans import CONTROLLER, lines_of, make_plan, without_timing
from full_disk import room_for
from toy_recordings import shown

from mpgrasp.bench.analysis.summary import summarise
from mpgrasp.bench.playing.crew import make_crew
from mpgrasp.bench.playing.player import Player, real_games
from mpgrasp.bench.record import ErrorLine, Line
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.simulation import Simulation


class Compiled(fakes.FakeDetector):
    name = "compiled"
    calls = 0

    @property
    def readiness(self) -> str:
        return f"compiled: ready in {self.calls} s"

    def warm_up(self) -> float:
        self.calls += 1
        return float(self.calls)


class Colourful(fakes.FakeDetector):
    name = "colourful"
    reads_colour = True


def player(detector: str, **settings: Any) -> Player:
    plan = make_plan(detectors=(f"{__name__}:{detector}",), controllers=(CONTROLLER,), **settings)
    return Player(plan, fakes.run_episode)


def test_what_compiles_does_so_before_the_first_episode_and_says_what_it_took() -> None:
    assert player("Compiled").prepare() == ["compiled: ready in 1 s"]


def test_what_does_not_compile_says_nothing() -> None:
    assert Player(make_plan(), fakes.run_episode).prepare() == []


def test_colour_is_refused_before_the_first_episode_where_rays_are_cast() -> None:
    with pytest.raises(ConfigError, match=r"reads colour, which takes OpenGL.*camera ray"):
        player("Colourful", camera="ray").prepare()


def recorded(folder: Path, workers: int) -> tuple[list[Line], list[str], int]:
    """Lines, notes and losses of two episodes, the first of which is recorded."""
    plan = make_plan(episodes=2, record=1, recordings=folder, camera="ray")
    crew = make_crew(plan, workers, run_episode=shown)
    lines: list[Line] = []
    notes: list[str] = []
    try:
        crew.play(plan.tasks(), lines.append, notes.append)
    finally:
        crew.close()
    return lines, notes, crew.losses


@pytest.mark.parametrize("workers", [0, 1])
def test_a_recording_that_finds_no_room_takes_nothing_from_its_episode(workers: int, tmp_path: Path) -> None:
    whole, roomy, nothing_lost = recorded(tmp_path / "roomy", 0)
    assert (roomy, nothing_lost) == ([], 0)
    assert {file.suffix for file in (tmp_path / "roomy").iterdir()} == {".rrd", ".gif", ".mp4"}
    with room_for(100_000):
        lines, notes, losses = recorded(tmp_path / "full", workers)
    assert without_timing(lines) == without_timing(whole)
    assert losses == 1
    assert len(notes) == 1
    assert re.match(r"episode 0 of thin .* counts, but .*is lost: a recording cannot be written", notes[0])
    assert ".rrd" in notes[0]
    assert not list((tmp_path / "full").glob("*.rrd"))
    assert not list((tmp_path / "full").glob(".*"))


def test_a_trace_that_cannot_be_written_takes_nothing_from_its_episode(tmp_path: Path) -> None:
    (tmp_path / "traces").write_text("in the way")
    plan = make_plan(episodes=1, traces=tmp_path / "traces", camera="ray")
    one = Player(plan, shown)
    line = one.play(next(plan.tasks()))
    assert without_timing([line]) == without_timing(lines_of(make_plan(episodes=1)))
    assert len(one.lost) == 1
    assert "a trace cannot be written" in one.lost[0]


@pytest.mark.parametrize(
    ("array", "value", "said"),
    [
        ("qpos", np.nan, "BADQPOS.*panda/joint7"),
        ("qvel", 1e12, "BADQVEL.*panda/joint7"),
        ("qfrc_applied", 1e30, "BADQACC"),
    ],
)
def test_what_the_simulator_warns_of_is_an_error_row_and_no_failure_of_the_method(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, array: str, value: float, said: str
) -> None:
    step = Simulation.step

    def spoilt(simulation: Simulation, n: int = 1) -> None:
        if simulation.time > 0.5:
            getattr(simulation.data.joint("panda/joint7"), array)[0] = value
        step(simulation, n)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Simulation, "step", spoilt)
    plan = make_plan(detectors=("oracle",), controllers=("mppc",), episodes=1, camera="ray")
    (line,) = lines_of(plan, real_games())
    assert isinstance(line, ErrorLine)
    assert re.search(rf"SimulationError: the simulator warned; got '.*{said}", line.error)
    (cell,) = summarise([line])
    assert (cell.n, cell.errors, cell.successes, cell.failures) == (0, 1, 0, {})
    assert not list(tmp_path.iterdir())
