from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from bench_runs import PLUG_INS, records, run_row

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.commands.run import make_parser
from mpgrasp.bench.playing.recorded_command import recorded_arguments


@pytest.fixture
def moved(fake_world: pytest.MonkeyPatch, tmp_path: Path) -> tuple[Path, Path, bytes]:
    """A run of a suite and weights of one's own, cut short; another directory to work in; its whole lines."""
    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    for folder in (home / "nets", elsewhere):
        folder.mkdir(parents=True)
    (home / "mine.toml").write_text('title = "Mine"\n[scene]\nobjects = ["key"]\n')
    (home / "nets" / "a=b.pt").write_bytes(b"weights")
    fake_world.chdir(home)
    weights = ["--weights", f"fakes:FakeDetector={Path('nets', 'a=b.pt')}"]
    arguments = ["mine.toml", *PLUG_INS, *weights, "--quiet", "--episodes", "3", "--out", "runs/one"]
    assert main(arguments) == 0
    run = home / "runs" / "one"
    whole = (run / "episodes.jsonl").read_bytes()
    (run / "episodes.jsonl").write_bytes(whole[: whole.index(b"\n") + 1])
    (run / "summary.json").unlink()
    fake_world.chdir(elsewhere)
    return run, elsewhere, whole


def test_a_run_is_resumed_and_replayed_from_any_directory_while_its_files_are_there(
    moved: tuple[Path, Path, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    run, _, whole = moved
    assert main(["--resume", "../home/runs/one"]) == 0
    hashes = [json.loads(line)["state_hash"] for line in whole.splitlines()]
    assert [line["state_hash"] for line in records(run)] == hashes
    assert json.loads((run / "summary.json").read_text())["complete"]
    capsys.readouterr()
    assert main(["replay", "../home/runs/one", "--episode", "2"]) == 0
    printed = capsys.readouterr().out
    assert "bit for bit the same" in printed
    assert "configuration" not in printed


def test_weights_that_were_moved_are_pointed_to_and_must_be_the_same(
    moved: tuple[Path, Path, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    run, elsewhere, _ = moved
    there, here = run.parents[1] / "nets" / "a=b.pt", elsewhere / "a=b.pt"
    there.rename(here)
    capsys.readouterr()
    for arguments in (["--resume", str(run)], ["replay", str(run), "--episode", "0"]):
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert f"not there any more; got '{Path('nets', 'a=b.pt')}'" in error
        assert "--weights" in error
        assert error.count("\n") == 1
    here.write_bytes(b"others")
    assert main(["--resume", str(run), "--weights", f"fakes:FakeDetector={here}"]) == 2
    assert "another configuration (detectors.0.sha256: " in capsys.readouterr().err
    here.write_bytes(b"weights")
    assert main(["--resume", str(run), "--weights", f"fakes:FakeDetector={here}"]) == 0
    assert len(records(run)) == 3
    assert main(["replay", str(run), "--episode", "0", "--weights", f"fakes:FakeDetector={here}"]) == 0


def test_what_decides_results_tells_files_by_name_and_hash_and_nobodys_folders(
    moved: tuple[Path, Path, bytes],
) -> None:
    configuration = json.loads((moved[0] / "run.json").read_text())["configuration"]
    (detector,) = configuration["detectors"]
    assert detector["weights"] == "a=b.pt"
    assert detector["sha256"] == hashlib.sha256(b"weights").hexdigest()
    text = json.dumps(configuration)
    assert "nets" not in text
    assert str(moved[1].parent) not in text


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("python -m mpgrasp.bench", "does not say by which command it was made"),
        ("python -m mpgrasp.bench 'thin", "does not say by which command it was made"),
        (3, "run.json cannot be used: Expected `str`, got `int` - at `$.command`"),
    ],
)
def test_a_run_that_does_not_say_how_it_was_made_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: object, message: str
) -> None:
    (tmp_path / "run.json").write_text(json.dumps(run_row(command=command)))
    assert main(["--resume", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_folder_called_as_the_scans_is_still_a_folder(tmp_path: Path) -> None:
    (tmp_path / "ycb").mkdir()
    command = "python -m mpgrasp.bench single --objects ./ycb ycb"
    run = tmp_path / "runs" / "one"
    run.mkdir(parents=True)
    (run / "run.json").write_text(json.dumps(run_row(command=command)))
    folder, scans = recorded_arguments(run, make_parser()).objects
    assert Path(folder) == tmp_path / "ycb"
    assert scans == "ycb"
