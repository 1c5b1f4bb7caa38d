from __future__ import annotations

import errno
import json
import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fakes
import numpy as np
import pytest
from bench_runs import PLUG_INS, records, records_without_timing, same_results, thin_command

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.exceptions import OutputError


@pytest.fixture
def whole(fake_world: object, tmp_path: Path) -> Path:
    """A run of 6 episodes that nothing has disturbed."""
    assert main(thin_command(tmp_path / "whole")) == 0
    return tmp_path / "whole"


@pytest.fixture
def part(fake_world: object, tmp_path: Path, whole: Path) -> Path:
    """The same run, killed after 5 lines, with its lines out of order."""
    out = tmp_path / "part"
    assert main(thin_command(out)) == 0
    lines = (out / "episodes.jsonl").read_text().splitlines(keepends=True)
    (out / "episodes.jsonl").write_text("".join([lines[1], lines[0], *lines[2:5]]))
    (out / "summary.json").unlink()
    return out


def test_a_resumed_run_ends_as_an_undisturbed_one(
    part: Path, whole: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = records(part)
    assert main(["--resume", str(part)]) == 0
    assert same_results(part, whole)
    assert all(line in records(part) for line in kept)  # timing included: they were not played again
    assert "are there already" not in capsys.readouterr().err  # the run was begun with --quiet
    assert len(json.loads((part / "run.json").read_text())["resumed"]) == 1


def test_a_resumed_run_says_how_much_is_there_unless_it_is_quiet(
    part: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    loud = [word for word in thin_command(part) if word not in ("--quiet", "--out", str(part))]
    capsys.readouterr()
    assert main([*loud, "--resume", str(part)]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith("mpgrasp: 5 episodes are there already\n[6/12, ")
    assert "already" not in printed.out


def test_an_unfinished_run_is_resumed_or_refused_but_never_begun_anew(
    part: Path, whole: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (part / "episodes.jsonl").read_bytes()
    capsys.readouterr()
    assert main(thin_command(part)) == 2
    printed = capsys.readouterr()
    assert f"unfinished (5 of 12 episodes are there); got '{part}'; allowed: --resume {part}" in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert (part / "episodes.jsonl").read_bytes() == before
    assert main(["--resume", str(part)]) == 0
    assert same_results(part, whole)
    assert main(thin_command(part)) == 0  # it is complete now
    assert same_results(part, whole)
    assert len((part / "episodes.previous.jsonl").read_bytes().splitlines()) == 12


def test_resuming_takes_the_whole_command_too_and_a_finished_run_is_left_as_it_is(
    part: Path, whole: Path
) -> None:
    arguments = [word for word in thin_command(part) if word not in ("--out", str(part))]
    assert main([*arguments, "--resume", str(part)]) == 0
    before = (part / "episodes.jsonl").read_bytes()
    assert main(["--resume", str(part)]) == 0
    assert (part / "episodes.jsonl").read_bytes() == before
    assert same_results(part, whole)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (["--seed", "1"], "seed: 0 there, 1 here"),
        (["--episodes", "9"], "episodes: 6 there, 9 here"),
        (["--no-noise"], "episode.noise: true there, false here"),
        (["--controller", "fakes:FakeController"], "cells: "),
    ],
)
def test_another_configuration_is_refused_by_name_and_nothing_changes(
    part: Path, capsys: pytest.CaptureFixture[str], change: list[str], named: str
) -> None:
    before = {file: file.read_bytes() for file in part.glob("*.json*")}
    assert main(["--resume", str(part), *change]) == 2
    error = capsys.readouterr().err
    assert "cannot resume with another configuration" in error
    assert named in error
    assert {file: file.read_bytes() for file in part.glob("*.json*")} == before


def test_a_plug_in_whose_source_has_changed_is_refused(
    part: Path, fake_world: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.bench.playing.description.source_hash", lambda kind, path: f"new {path}")
    before = (part / "episodes.jsonl").read_bytes()
    assert main(["--resume", str(part)]) == 2
    assert "source: " in capsys.readouterr().err
    assert (part / "episodes.jsonl").read_bytes() == before


def test_another_version_is_noted_and_written_down(
    part: Path, fake_world: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.bench.results.provenance.PACKAGES", ("numpy",))
    assert main(["--resume", str(part)]) == 0
    assert "not made with the same" in capsys.readouterr().err
    (entry,) = json.loads((part / "run.json").read_text())["resumed"]
    assert list(entry["made_with"]["packages"]) == ["numpy"]


@pytest.mark.parametrize("rest", ['{"episode": 2, "suite": "th', "\x00\x00\x00\x00", '{"half": 1}', "{"])
def test_a_torn_last_line_is_cut_off_with_a_note_and_nothing_is_lost(
    part: Path, whole: Path, capsys: pytest.CaptureFixture[str], rest: str
) -> None:
    kept = records(part)
    with (part / "episodes.jsonl").open("a") as file:
        file.write(rest)
    assert main(["--resume", str(part)]) == 0
    assert "was not whole" in capsys.readouterr().err
    assert same_results(part, whole)
    assert all(line in records(part) for line in kept)


def test_a_broken_line_in_the_middle_is_an_error_and_is_left_alone(
    part: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (part / "episodes.jsonl").read_bytes().splitlines(keepends=True)
    (part / "episodes.jsonl").write_bytes(b"".join([lines[0], b"?\n", *lines[2:]]))
    before = (part / "episodes.jsonl").read_bytes()
    assert main(["--resume", str(part)]) == 2
    assert "line 2 is not an episode's" in capsys.readouterr().err
    assert (part / "episodes.jsonl").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"success": "yes"}, "line 2 is not an episode's"),
        ({"outcome": "missed"}, "outcome 'missed' beside success True"),
        ({"sim_time_s": -1.0}, "below 0"),
        ({"seed": 5}, "is of no episode of this run"),
        ({"scene_seed": 5}, "is of no episode of this run"),
        ({"episode": 999}, "is of no episode of this run"),
        ({"episode": -1}, "line 2 is not an episode's"),
        ({"scene_seed": 2**70}, "line 2 is not an episode's"),
        ({"detector": "oracle"}, "is of no episode of this run"),
        ({"suite": "unseen"}, "is of no episode of this run"),
    ],
)
def test_an_edited_line_is_an_error_and_is_left_alone(
    part: Path, capsys: pytest.CaptureFixture[str], change: dict[str, Any], reason: str
) -> None:
    first, second, *rest = (part / "episodes.jsonl").read_text().splitlines(keepends=True)
    edited = json.dumps({**json.loads(second), "success": True, "outcome": "success", **change}) + "\n"
    (part / "episodes.jsonl").write_text("".join([first, edited, *rest]))
    before = (part / "episodes.jsonl").read_bytes()
    assert main(["--resume", str(part)]) == 2
    assert reason in capsys.readouterr().err
    assert sorted((part / "episodes.jsonl").read_bytes().splitlines()) == sorted(before.splitlines())


def test_error_rows_are_tried_again(fake_world: pytest.MonkeyPatch, whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "broken"
    fake_world.setattr("mpgrasp.episode.episode.run_episode", fakes.breaks_off)
    assert main(thin_command(out)) == 1
    fake_world.setattr("mpgrasp.episode.episode.run_episode", fakes.run_episode)
    assert main(["--resume", str(out)]) == 0
    assert same_results(out, whole)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--resume", "absent"], "no run there"),
        (["thin", "--resume", "absent", *PLUG_INS], "no run there"),
        (["--resume", "absent", "--out", "elsewhere"], "--out beside --resume"),
    ],
)
def test_nothing_to_resume_is_one_line_and_exit_code_2(
    fake_world: object, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def full_after(count: int) -> Callable[[int, bytes], int]:
    """An os.write to a disk on which so many lines have room, and half of another."""
    write, written = os.write, [0]

    def fake(file: int, data: bytes) -> int:
        written[0] += 1
        if written[0] <= count:
            return write(file, data)
        if written[0] == count + 1:
            return write(file, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return fake


def test_a_disk_that_fills_up_keeps_the_finished_episodes_and_can_be_resumed(
    fake_world: pytest.MonkeyPatch, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "full"
    with pytest.MonkeyPatch.context() as disk:
        disk.setattr("os.write", full_after(3))
        assert main(thin_command(out)) == 2
    assert "cannot be written (disk full)" in capsys.readouterr().err
    assert records_without_timing(out) == records_without_timing(whole)[:3]
    assert main(["--resume", str(out)]) == 0
    assert same_results(out, whole)


def test_a_summary_that_finds_no_room_is_an_error_and_the_lines_stay(
    fake_world: pytest.MonkeyPatch, whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_room(file: Path, text: str) -> None:
        if file.name != "run.json":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        file.write_text(text)

    out = tmp_path / "full"
    with pytest.MonkeyPatch.context() as disk:
        disk.setattr("mpgrasp.bench.results.writer.replace_file", no_room)
        assert main(thin_command(out)) == 2
    printed = capsys.readouterr()
    assert "No space left" in printed.err
    assert "interval" in printed.out
    assert records_without_timing(out) == records_without_timing(whole)
    assert main(["--resume", str(out)]) == 0
    assert same_results(out, whole)


def test_a_read_only_directory_is_refused(
    part: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def read_only(path: Any, flags: int, *mode: int, **other: Any) -> int:
        if flags & (os.O_WRONLY | os.O_RDWR):
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        return real(path, flags, *mode, **other)

    real = os.open
    before = (part / "episodes.jsonl").read_bytes()
    monkeypatch.setattr("os.open", read_only)  # also where root may write anywhere
    assert main(["--resume", str(part)]) == 2
    assert "Read-only file system" in capsys.readouterr().err
    assert (part / "episodes.jsonl").read_bytes() == before


def test_two_processes_do_not_write_to_one_run(part: Path) -> None:
    content = read_run(part)
    first = RunDirectory.resume(part, content, print)
    with pytest.raises(OutputError, match="another process is writing"):
        RunDirectory.resume(part, content, print)
    first.close()
    RunDirectory.resume(part, content, print).close()


def _run_silently(arguments: list[str]) -> None:
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    os._exit(main(arguments))


def _killed(arguments: list[str], out: Path, wait_for: int, delay: float) -> bool:
    """Start a run and kill it, a while after so many lines are there; whether it was still at it."""
    process = multiprocessing.get_context("fork").Process(target=_run_silently, args=(arguments,))
    process.start()
    deadline = time.monotonic() + 30
    while _count(out) < wait_for and process.is_alive() and time.monotonic() < deadline:
        time.sleep(0.001)
    time.sleep(delay)
    assert process.pid is not None
    os.kill(process.pid, signal.SIGKILL)
    process.join()
    return process.exitcode == -signal.SIGKILL


def _count(out: Path) -> int:
    file = out / "episodes.jsonl"
    return file.read_bytes().count(b"\n") if file.exists() else 0


def test_killed_20_times_a_run_ends_with_the_summary_of_an_undisturbed_one(
    fake_world: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", fakes.brisk)
    whole, out = tmp_path / "whole", tmp_path / "killed"
    assert main(thin_command(whole, episodes=200)) == 0
    rng = np.random.default_rng(0)
    kills = 0
    for k in range(20):
        begun = (out / "run.json").exists()
        before = _count(out)
        arguments = ["--resume", str(out)] if begun else thin_command(out, episodes=200)
        # the first ones wherever they strike on the way to the first episode, the others in the midst
        moment = (0, rng.uniform(0, 0.1)) if k < 5 else (before + 3, rng.uniform(0, 0.01))
        kills += _killed(arguments, out, *moment)
        assert _count(out) >= before
    assert kills == 20
    assert 40 < _count(out) < 400
    assert main(["--resume", str(out)]) == 0
    assert same_results(out, whole)
