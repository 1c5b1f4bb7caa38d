"""A method that fails alike from its first episode on ends the run; nothing that was played is lost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_plans import lines_of, make_plan
from bench_runs import PLUG_INS, error_row, grasp_row, records

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.playing.patience import Patience
from mpgrasp.bench.playing.player import EpisodeError, Player
from mpgrasp.bench.record import ErrorLine, Line, line_of
from mpgrasp.exceptions import PlugInError
from mpgrasp.suite import load_suite


def error(episode: int, what: str, **where: Any) -> Line:
    line = line_of(error_row(episode=episode, **where))
    return line_of(error_row(episode=episode, error=f"{line.task} {what}", **where))


@pytest.mark.parametrize("episodes", [(0, 1, 2), (2, 0, 1), (4, 0, 2)])
def test_the_same_error_in_three_of_the_first_five_episodes_ends_it_in_whatever_order_they_come(
    episodes: tuple[int, int, int],
) -> None:
    patience = Patience()
    for episode in episodes[:2]:
        patience.see(error(episode, f"broke off: quality from -{episode}.25 to 3e-{episode}"))
    with pytest.raises(
        EpisodeError, match=r"d/c fails alike in 3 of its first 5 episodes of s.*quality from -12"
    ):
        patience.see(error(episodes[2], "broke off: quality from -12 to 0.5"))


@pytest.mark.parametrize(
    "lines",
    [
        [error(0, "a"), error(1, "a"), error(2, "b"), error(3, "b"), error(4, "c")],
        [error(0, "a"), line_of(grasp_row(episode=1)), line_of(grasp_row(episode=2)), error(3, "a")],
        [error(3, "a"), error(4, "a"), error(5, "a"), error(6, "a")],
        [error(0, "a"), error(1, "a"), error(2, "a", detector="e")],
        [error(0, "a"), error(0, "a"), error(0, "a")],
    ],
    ids=["another-error", "most-played", "not-the-first", "two-methods", "one-episode"],
)
def test_anything_else_goes_on(lines: list[Line]) -> None:
    patience = Patience()
    for line in lines:
        patience.see(line)


def unusable(scene_config: Any, seed: int, **_: Any) -> Any:
    """Every episode meets a plug-in that returns what cannot be used."""
    raise PlugInError("detector fake: the map's quality is out of range", got=seed, allowed="0 to 1")


@pytest.mark.parametrize("workers", [0, 1])
def test_what_cannot_be_used_is_not_tried_again(workers: int) -> None:
    lines = lines_of(make_plan(episodes=2), unusable, workers)
    for line in lines:
        assert isinstance(line, ErrorLine)
        assert "PlugInError: detector fake: the map's quality is out of range; got" in line.error
        assert "attempt 2" not in line.traceback


def test_a_run_that_ends_so_says_it_and_keeps_its_rows(
    tmp_path: Path, fake_world: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", unusable)
    out = tmp_path / "run"
    assert main(["thin", *PLUG_INS, "--quiet", "--episodes", "50", "--out", str(out)]) == 1
    assert [row["episode"] for row in records(out)] == [0, 1, 2]
    assert "fails alike in 3 of its first 5 episodes" in capfd.readouterr().err


def leaves(scene_config: Any, seed: int, **_: Any) -> Any:
    raise SystemExit(0)


def test_a_plug_in_that_exits_does_not_end_the_run() -> None:
    lines = lines_of(make_plan(episodes=2), leaves)
    assert len(lines) == 2
    assert all("SystemExit: 0" in line.error for line in lines if isinstance(line, ErrorLine))


def talks(scene_config: Any, seed: int, **_: Any) -> Any:
    print("my network says hello")
    return fakes.run_episode(scene_config, seed)


def test_what_a_plug_in_prints_goes_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    lines_of(make_plan(episodes=2), talks)
    printed = capsys.readouterr()
    assert "hello" not in printed.out
    assert printed.err.count("hello") == 2


def test_whoever_clears_a_table_is_told_that_its_controller_forgets_failures() -> None:
    def told(suite: str, controller: str) -> list[str]:
        plan = replace(make_plan(controllers=(controller,)), suites=(load_suite(suite),))
        return Player(plan, fakes.run_episode).prepare()

    assert (
        "fakes:FakeController has no remember_failure(position)" in told("stacked", "fakes:FakeController")[0]
    )
    assert told("stacked", "mppc") == told("thin", "fakes:FakeController") == []
