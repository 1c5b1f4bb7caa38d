"""Laws of the leaderboard: what was changed, is not whole or cannot be repeated does not count."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import PLUG_INS

from mpgrasp.bench.__main__ import main

Change = Callable[[dict[str, Any], list[dict[str, Any]]], None]


def submitted(folder: Path, change: Change | None = None, *words: str) -> Path:
    """A run as someone submits it, made from a clean checkout, with what they changed in its files."""
    assert main(["thin", *PLUG_INS, "--episodes", "3", "--quiet", "--out", str(folder), *words]) == 0
    run = json.loads((folder / "run.json").read_text())
    lines = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    run["made_with"]["git"] = {"commit": "0" * 40, "modified": False}
    if change is not None:
        change(run, lines)
    (folder / "run.json").write_text(json.dumps(run))
    (folder / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder


def test_a_run_that_repeats_is_ranked(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = submitted(tmp_path / "a")
    capsys.readouterr()
    assert main(["leaderboard", str(run), "--out", str(tmp_path / "board.md")]) == 0
    said = capsys.readouterr().out
    assert f"{run}: passed" in said
    assert "fakes:FakeDetector + fakes:FakeController" in said
    board = (tmp_path / "board.md").read_text()
    assert "## thin" in board
    assert "- `a`: passed" in board


def _other_world(run: dict[str, Any], lines: list[dict[str, Any]]) -> None:
    lines[1]["scene_seed"] += 1


def _modified(run: dict[str, Any], lines: list[dict[str, Any]]) -> None:
    run["made_with"]["git"]["modified"] = True


def _shorter_way(run: dict[str, Any], lines: list[dict[str, Any]]) -> None:
    run["configuration"]["suite"]["scenes"][0]["half_extent"] = 0.01


def _better(run: dict[str, Any], lines: list[dict[str, Any]]) -> None:
    for line in lines:
        line["state_hash"] = "0" * 64


@pytest.mark.parametrize(
    ("change", "words", "said"),
    [
        (_other_world, [], "1 episodes in worlds that are not those of seed 0"),
        (_modified, [], "not made from a checkout without changes"),
        (_shorter_way, [], "thin was changed"),
        (_better, [], "does not come out the same"),
        (None, ["--set", "scene.cloth_unevenness=0"], "thin was changed"),
        (None, ["--set", "sensor.subpixel=0.01"], "thin was changed"),
        (None, ["--no-noise"], "played without the sensor's noise"),
    ],
)
def test_what_does_not_count_is_left_out_and_it_is_said_why(
    change: Change | None,
    words: list[str],
    said: str,
    fake_world: object,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run = submitted(tmp_path / "bad", change, *words)
    capsys.readouterr()
    assert main(["leaderboard", str(run)]) == 1
    printed = capsys.readouterr().out
    assert said in printed
    assert "success" not in printed


def test_a_run_that_is_not_complete_or_whose_plug_in_is_missing_is_said_to_be(
    fake_world: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = submitted(tmp_path / "cut")
    (run / "summary.json").unlink()
    other = submitted(tmp_path / "gone", None, "--seed", "5")
    fake_world.delattr(fakes, "FakeDetector")
    capsys.readouterr()
    assert main(["leaderboard", str(other)]) == 1
    assert "cannot be played again here" in capsys.readouterr().out
    shutil.rmtree(other)
    assert main(["leaderboard", str(run), "--replay", "0"]) == 1
    assert "not complete" in capsys.readouterr().out
