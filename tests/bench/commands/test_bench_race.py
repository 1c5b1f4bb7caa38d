"""Laws of `bench race`: it ends when one is known to be better, at the same world whatever plays it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import PLUG_INS, records, records_without_timing

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.analysis.race import state_of
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import by_cell

A, B = "fakes:FakeDetector/fakes:FakeController", "fakes:OtherDetector/fakes:FakeController"


def play(scene: Any, seed: int, *, detector: Any, **_: Any) -> fakes.FakeResult:
    """One method nearly always succeeds, the other in six of ten worlds."""
    limit = 0.97 if type(detector) is fakes.FakeDetector else 0.6
    success = (seed % 997) / 997 < limit
    return fakes.FakeResult(seed - seed % 3 + success, scene)


def same(scene: Any, seed: int, **_: Any) -> fakes.FakeResult:
    return fakes.FakeResult(seed, scene)


@pytest.fixture
def race_world(fake_world: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", play)
    return fake_world


def race(out: Path, *more: str) -> list[str]:
    return ["race", B, A, "--suite", "thin", "--workers", "0", "--quiet", "--out", str(out), *more]


@pytest.mark.usefixtures("race_world")
def test_a_race_ends_when_one_is_known_to_be_better(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(race(tmp_path / "run")) == 0
    said = capsys.readouterr().out
    assert f"{A} is better: after " in said
    card = read_run(tmp_path / "run").configuration.race
    assert card is not None
    cells = by_cell(RunDirectory(tmp_path / "run").episodes())
    state = state_of(card, "thin", cells)
    assert state.winner == A
    assert state.p <= 0.05
    assert state.pairs % card.step == 0
    assert state.pairs < 100
    assert not state_of(card, "thin", cells, state.pairs - card.step).decided
    assert f"{A} is better" in (tmp_path / "run" / "report.md").read_text()
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["complete"]


@pytest.mark.usefixtures("race_world")
def test_a_smaller_alpha_takes_longer(tmp_path: Path) -> None:
    assert main(race(tmp_path / "a")) == 0
    assert main(race(tmp_path / "b", "--alpha", "0.0001")) == 0
    assert len(records(tmp_path / "b")) > len(records(tmp_path / "a"))


def test_equal_methods_go_on_to_the_end_and_nothing_is_claimed(
    fake_world: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", same)
    assert main(race(tmp_path / "run", "--max-episodes", "23")) == 0
    assert "not decided: after 23 worlds" in capsys.readouterr().out
    assert len(records(tmp_path / "run")) == 46


@pytest.mark.usefixtures("race_world")
def test_an_interrupted_race_goes_on_as_if_it_had_not_been(tmp_path: Path) -> None:
    whole, torn = tmp_path / "whole", tmp_path / "torn"
    assert main(race(whole)) == 0
    lines = (whole / "episodes.jsonl").read_text().splitlines(keepends=True)
    for kept in (0, 7, len(lines)):
        shutil.rmtree(torn, ignore_errors=True)
        shutil.copytree(whole, torn)
        (torn / "episodes.jsonl").write_text("".join(lines[:kept]))
        (torn / "summary.json").unlink()
        assert main(["race", "--resume", str(torn), "--workers", "0", "--quiet"]) == 0
        assert records_without_timing(torn) == records_without_timing(whole)


@pytest.mark.usefixtures("race_world")
def test_a_race_is_resumed_as_a_race_and_nothing_else_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(race(tmp_path / "race")) == 0
    assert main(["--resume", str(tmp_path / "race")]) == 2
    assert main(["thin", *PLUG_INS, "--quiet", "--episodes", "2", "--out", str(tmp_path / "run")]) == 0
    assert main(["race", "--resume", str(tmp_path / "run")]) == 2
    assert capsys.readouterr().err.count("a race is resumed as a race") == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "the following arguments are required: SUITE"),
        ([A], "a race is of two methods"),
        ([A, "oracle", "--suite", "thin"], "unusable method; got 'oracle'"),
        ([A, A, "--suite", "thin"], "a race of a method with itself"),
        ([A, B], "the following arguments are required: --suite"),
        ([A, B, "--suite", "thick"], "unknown suite; got 'thick'"),
        ([A, B, "--suite", "paper"], "a race in several suites"),
        ([A, B, "--suite", "thin", "--alpha", "0"], "unusable number; got '0'"),
        ([A, B, "--suite", "thin", "--episodes", "5"], "a race with --episodes"),
        ([A, B, "--suite", "thin", "--detector", "oracle"], "a race with --detector"),
        ([A, B, "--suite", "thin", "--until-ci", "5"], "a race with --until-ci"),
        (["orcale/mppc", B, "--suite", "thin"], "unknown detector; got 'orcale'"),
        (["oracle/mpcc", B, "--suite", "thin"], "unknown controller; got 'mpcc'"),
    ],
)
def test_what_is_no_race_is_refused_in_a_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["race", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
