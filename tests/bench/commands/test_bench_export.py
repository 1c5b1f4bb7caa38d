"""`python -m mpgrasp.bench export`: episodes are written as they were, or left out and told."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import pytest
from bench_runs import records

from mpgrasp.bench.__main__ import main


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "run"
    words = ["thin", "--detector", "oracle,heuristic", "--controller", "mppc", "--episodes", "2"]
    assert main([*words, "--workers", "0", "--quiet", "--out", str(out)]) == 0
    return out


CELL = ["--cell", "oracle/mppc"]


def test_every_episode_of_a_cell_is_written(
    played: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {file: file.read_bytes() for file in played.glob("*.json*")}
    assert main(["export", str(played), *CELL, "--out", str(tmp_path / "demos")]) == 0
    assert "2 demonstrations" in capsys.readouterr().out
    index = json.loads((tmp_path / "demos" / "index.json").read_text())
    mine = [row for row in records(played) if row["detector"] == "oracle"]
    assert [row["length"] for row in index["demonstrations"]] == [row["ticks"] - 1 for row in mine]
    assert [row["episode"]["state_hash"] for row in index["demonstrations"]] == [
        r["state_hash"] for r in mine
    ]
    assert (index["suite"], index["detector"], index["fps"]) == ("thin", "oracle", 10)
    assert {file: file.read_bytes() for file in played.glob("*.json*")} == before


def test_what_does_not_come_out_the_same_is_left_out_and_told(
    played: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = Path(shutil.copytree(played, tmp_path / "other"))
    first = next(row for row in records(played) if row["detector"] == "oracle")
    text = (other / "episodes.jsonl").read_text()
    (other / "episodes.jsonl").write_text(text.replace(first["state_hash"], "0" * 64))
    assert main(["export", str(other), *CELL, "--out", str(tmp_path / "demos"), "--format", "hdf5"]) == 1
    printed = capsys.readouterr()
    assert "1 demonstrations" in printed.out
    assert "does not come out as in the run" in printed.err
    with h5py.File(tmp_path / "demos" / "demonstrations.hdf5") as file:
        assert list(file["data"]) == ["demo_0"]


def test_failures_are_left_out_where_successes_are_wanted(
    played: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = Path(shutil.copytree(played, tmp_path / "other"))
    lines = [json.loads(line) for line in (other / "episodes.jsonl").read_text().splitlines()]
    for line in lines:
        line.update(outcome="missed", success=False)
    (other / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    command = ["export", str(other), *CELL, "--out", str(tmp_path / "demos"), "--successes"]
    assert main(command) == 2
    assert "no episode to export" in capsys.readouterr().err
    assert not (tmp_path / "demos").exists()


def test_several_cells_and_folders_in_use_are_refused(
    played: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(played), "--out", str(tmp_path / "demos")]) == 2
    assert "the run has several cells" in capsys.readouterr().err
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("keep me")
    assert main(["export", str(played), *CELL, "--out", str(tmp_path / "full")]) == 2
    assert "something already" in capsys.readouterr().err
    assert [file.name for file in (tmp_path / "full").iterdir()] == ["mine.txt"]
