"""`python -m mpgrasp.bench replay`: an episode played again is the same, or it is said what differs."""

from __future__ import annotations

from pathlib import Path

import fakes
import pytest
from bench_runs import records, thin_command

from mpgrasp.bench.__main__ import main


@pytest.fixture
def run(fake_world: object, tmp_path: Path) -> Path:
    assert main(thin_command(tmp_path / "run", episodes=3)) == 0
    return tmp_path / "run"


CELL = ["--cell", "fakes:FakeDetector/fakes:OtherController"]


def test_a_replay_says_that_it_is_the_same(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {file: file.read_bytes() for file in run.glob("*.json*")}
    capsys.readouterr()
    assert main(["replay", str(run), "--episode", "2", *CELL]) == 0
    expected = records(run)[-1]
    printed = capsys.readouterr().out
    assert "bit for bit the same" in printed
    assert expected["outcome"] in printed
    assert {file: file.read_bytes() for file in run.glob("*.json*")} == before


def test_a_replay_says_what_differs(
    run: Path, fake_world: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", fakes.other_world)
    fake_world.setattr("mpgrasp.bench.results.provenance.PACKAGES", ())
    assert main(["replay", str(run), "--episode", "2", *CELL]) == 1
    printed = capsys.readouterr().out
    assert "not the same as in the run" in printed
    assert "ticks: 50 then, 51 now" in printed
    assert "state_hash" not in printed
    assert "Not made with the same: packages" in printed


def test_a_replay_names_a_configuration_that_has_changed(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (run / "run.json").read_text()
    (run / "run.json").write_text(text.replace('"start_height": 0.5', '"start_height": 0.6'))
    assert main(["replay", str(run), "--episode", "0", *CELL]) == 0
    assert "episode.start_height: 0.6 then, 0.5 now" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--episode", "0"], "the run has several cells"),
        (["--episode", "9", *CELL], "the run has no episode 9"),
        (["--episode", "-1", *CELL], "--episode: unusable number; got '-1'"),
        (["--episode", "0", "--cell", "oracle/mppc"], "no such cell; got 'oracle/mppc'"),
        (CELL, "required: --episode"),
    ],
)
def test_what_cannot_be_replayed_is_one_line_and_exit_code_2(
    run: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    capsys.readouterr()
    assert main(["replay", str(run), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_no_run_no_replay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(tmp_path), "--episode", "0"]) == 2
    assert "no run there" in capsys.readouterr().err
