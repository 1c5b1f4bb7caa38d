"""Laws of `bench ladder` and `bench ladders`: results alone decide on the next episodes."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import PLUG_INS, records_without_timing

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.analysis.ladder import climbs, comparisons
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import by_cell

RUNGS = [0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6]


def play(scene: Any, seed: int, *, detector: Any, **_: Any) -> fakes.FakeResult:
    """An episode that succeeds from a thickness on: one method from 0.9 mm, the other from 1.8 mm."""
    thickness = 2000 * scene.objects[0].parts[0].size[2]
    limit = 0.9 if type(detector) is fakes.FakeDetector else 1.8
    luck = seed % 997 / 997
    success = luck < 1 / (1 + (limit / thickness) ** 8)
    return fakes.FakeResult(seed - seed % 3 + success, scene)


@pytest.fixture
def ladder_world(fake_world: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", play)
    return fake_world


def command(out: Path, *more: str, name: str = "thickness", episodes: int = 80) -> list[str]:
    methods = ["--detector", "fakes:FakeDetector,fakes:OtherDetector", *PLUG_INS[2:]]
    return ["ladder", name, *methods, "--quiet", "--episodes", str(episodes), "--out", str(out), *more]


@pytest.mark.usefixtures("ladder_world")
def test_a_ladder_ends_with_the_level_at_which_each_method_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command(tmp_path / "run")) == 0
    out = capsys.readouterr().out
    assert "to 90 %" in out
    assert "to 50 %" in out
    card = read_run(tmp_path / "run").configuration.ladder
    assert card is not None
    assert list(card.rungs) == RUNGS
    found = climbs(card, by_cell(RunDirectory(tmp_path / "run").episodes()))
    assert [climb.episodes for climb in found] == [80, 80]
    levels = {climb.method.detector: climb.thresholds[-1] for climb in found}
    assert levels["fakes:FakeDetector"].low <= 0.9 <= levels["fakes:FakeDetector"].high
    assert levels["fakes:OtherDetector"].low <= 1.8 <= levels["fakes:OtherDetector"].high
    (at_50,) = (row for row in comparisons(card.scale, found) if row.rate == 0.5)
    assert at_50.p_holm < 0.001
    assert at_50.found.low <= 0.5 <= at_50.found.high
    html = (tmp_path / "run" / "report.html").read_text()
    assert html.index('id="ladders"') < html.index('id="results"')
    assert "How thin a stick is still grasped" in html
    assert "[&#39;" not in html


@pytest.mark.usefixtures("ladder_world")
def test_an_interrupted_ladder_goes_on_as_if_it_had_not_been(tmp_path: Path) -> None:
    whole, torn = tmp_path / "whole", tmp_path / "torn"
    assert main(command(whole, episodes=56)) == 0
    lines = (whole / "episodes.jsonl").read_text().splitlines(keepends=True)
    for kept in (0, 41, 85, len(lines)):
        shutil.rmtree(torn, ignore_errors=True)
        shutil.copytree(whole, torn)
        (torn / "episodes.jsonl").write_text("".join(lines[:kept]))
        (torn / "summary.json").unlink()
        assert main(["ladder", "--resume", str(torn), "--workers", "0", "--quiet"]) == 0
        assert records_without_timing(torn) == records_without_timing(whole)


@pytest.mark.usefixtures("ladder_world")
def test_a_method_plays_the_same_rungs_whoever_plays_beside_it(tmp_path: Path) -> None:
    assert main(command(tmp_path / "both")) == 0
    alone = command(tmp_path / "alone")
    alone[alone.index("--detector") + 1] = "fakes:OtherDetector"
    assert main(alone) == 0
    both = [row for row in records_without_timing(tmp_path / "both") if "Other" in row["detector"]]
    assert both == records_without_timing(tmp_path / "alone")


@pytest.mark.usefixtures("ladder_world")
def test_all_ladders_leave_a_run_each_and_one_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.toml").write_text("title = 'unused'")
    words = ["ladders", "thickness", *PLUG_INS, "--quiet", "--episodes", "40", "--out", str(tmp_path / "all")]
    assert main(words) == 0
    before = (tmp_path / "all" / "thickness" / "episodes.jsonl").read_bytes()
    assert main(words) == 0, "the same command again finds nothing left to play"
    assert (tmp_path / "all" / "thickness" / "episodes.jsonl").read_bytes() == before
    assert "Report on all:" in capsys.readouterr().out
    assert (tmp_path / "all" / "report.html").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["ladder", "thick"], "unknown ladder; got 'thick'; allowed: calibration, "),
        (["ladder"], "the following arguments are required: SUITE"),
        (["ladder", "thickness", "--until-ci", "5"], "a ladder with --until-ci"),
        (["ladder", "thickness", "--shard", "1/2"], "a ladder with --shard"),
        (["ladder", "thickness", "--objects", "ycb"], "a ladder with --objects"),
        (["ladder", "thickness", "--suites", "thin"], "a ladder with --suites"),
        (["ladder", "thickness", "--baseline", "robust"], "a ladder with --baseline"),
        (["ladder", "thickness", "--set", "scene.objects=[]"], "a scene without objects"),
        (["ladders", "thickness,thick"], "unknown ladder; got 'thickness,thick'"),
        (["ladders", "--resume", "x"], "ladders with --resume"),
    ],
)
def test_what_is_no_ladder_is_refused_in_a_line(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = [] if "--resume" in words else ["--out", str(tmp_path / "out")]
    assert main([*words, *out]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("ladder_world")
def test_a_run_that_is_no_ladder_is_not_resumed_as_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["thickness.toml", *PLUG_INS, "--out", str(out)]) == 2
    assert main(["thin_2mm", *PLUG_INS, "--quiet", "--episodes", "2", "--out", str(out)]) == 0
    assert main(["ladder", "--resume", str(out), "--quiet"]) == 2
    assert "the run that is to be resumed is no ladder" in capsys.readouterr().err


@pytest.mark.usefixtures("ladder_world")
def test_run_json_says_how_rungs_were_chosen(tmp_path: Path) -> None:
    assert main(command(tmp_path / "run", episodes=40)) == 0
    card = json.loads((tmp_path / "run" / "run.json").read_text())["configuration"]["ladder"]
    assert (card["episodes"], card["first"], card["batch"]) == (40, 8, 8)
    assert card["points"][0] == "thickness[mm=0.5]"
