from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_runs import clearing_row, configuration_row, error_row, grasp_row, run_row

from mpgrasp.bench.analysis.summary import RunSummary
from mpgrasp.bench.record import line_of, record_of
from mpgrasp.bench.results.reader import read_lines, read_run, read_summary
from mpgrasp.bench.results.run_card import RunDescription
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.exceptions import OutputError
from mpgrasp.files.json_values import one_line

RUN = record_of(RunDescription, run_row())
LINE = line_of(grasp_row())
SUMMARY = RunSummary(complete=True, cells=(), paired_tests=())


def test_a_run_directory_holds_every_line_at_once(tmp_path: Path) -> None:
    directory = RunDirectory.create(tmp_path / "a" / "b", RUN)
    for k in range(3):
        rough = {"jerk_rms": float(np.float64(1 / 3)), "blind_drift_m": float("nan")}
        directory.append(line_of(grasp_row(episode=k, **rough)))
        assert len(directory.episodes_file.read_bytes().splitlines()) == k + 1
    assert directory.episodes()[0] == line_of(grasp_row(episode=0, jerk_rms=0.333333333))
    directory.write_summary(SUMMARY)
    assert read_summary(directory.path) == SUMMARY
    assert read_run(directory.path) == RUN


def test_every_line_is_on_the_disk_when_it_is_said_to_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    directory = RunDirectory.create(tmp_path, RUN)
    real = os.fsync

    def fsync(file: int) -> None:
        real(file)
        synced.append(os.fstat(file).st_size)

    monkeypatch.setattr(os, "fsync", fsync)
    for k in range(3):
        directory.append(line_of(grasp_row(episode=k)))
        assert synced[-1] == directory.episodes_file.stat().st_size
    assert len(synced) == 3


def test_the_traceback_of_an_error_lies_in_a_file_of_its_own(tmp_path: Path) -> None:
    directory = RunDirectory.create(tmp_path, RUN)
    directory.append(line_of(error_row(traceback="line 1\nline 2\n")))
    assert list(directory.episodes()) == [line_of(error_row(traceback="errors/s-d-c-0000.txt"))]
    assert (tmp_path / "errors" / "s-d-c-0000.txt").read_text() == "line 1\nline 2\n"


def test_a_directory_with_another_run_is_refused_and_left_alone(tmp_path: Path) -> None:
    first = RunDirectory.create(tmp_path, RUN)
    first.append(LINE)
    first.close()
    before = {path: path.read_bytes() for path in tmp_path.glob("*.json*")}
    with pytest.raises(OutputError, match=r"another run \(seed: 0 there, 1 here\)"):
        RunDirectory.create(tmp_path, record_of(RunDescription, run_row(configuration_row(seed=1))))
    assert {path: path.read_bytes() for path in tmp_path.glob("*.json*")} == before


@pytest.mark.parametrize(("files", "shown"), [("ab", "a, b"), ("abc", "a, b, c"), ("dcba", "a, b, c, ...")])
def test_a_directory_of_other_files_is_refused_by_their_names(tmp_path: Path, files: str, shown: str) -> None:
    for name in files:
        (tmp_path / name).write_text("mine")
    with pytest.raises(OutputError, match=re.escape(f"holds no run ({shown});")):
        RunDirectory.create(tmp_path, RUN)


def test_lines_may_be_read_by_whom_the_user_lets(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        directory = RunDirectory.create(tmp_path / "run", RUN)
    finally:
        os.umask(before)
    assert directory.episodes_file.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("read", [read_lines, read_run])
def test_files_that_cannot_be_read_are_an_output_error(
    read: Callable[[Path], object], tmp_path: Path
) -> None:
    with pytest.raises(OutputError, match=str(tmp_path)):
        read(tmp_path)


def test_a_complete_run_again_starts_afresh_and_keeps_the_lines_of_every_time(tmp_path: Path) -> None:
    for k in range(3):
        directory = RunDirectory.create(tmp_path, RUN)
        assert list(directory.episodes()) == []
        directory.append(line_of(grasp_row(sim_time_s=float(k))))
        directory.write_summary(SUMMARY)
        directory.close()
    kept = {
        file.name: json.loads(file.read_text())["sim_time_s"] for file in tmp_path.glob("episodes*.jsonl")
    }
    assert kept == {
        "episodes.previous.jsonl": 0.0,
        "episodes.previous-2.jsonl": 1.0,
        "episodes.jsonl": 2.0,
    }


UNFINISHED = '{"complete": false, "cells": [], "paired_tests": []}'


@pytest.mark.parametrize("summary", [None, UNFINISHED, '{"complete": true}', "{", "[]"])
@pytest.mark.parametrize("planned", [3, None])
def test_an_unfinished_run_is_not_begun_anew(
    tmp_path: Path, summary: str | None, planned: int | None
) -> None:
    first = RunDirectory.create(tmp_path, RUN)
    first.append(LINE)
    first.append(line_of(error_row(episode=1)))
    first.close()
    if summary is not None:
        (tmp_path / "summary.json").write_text(summary)
    before = {path: path.read_bytes() for path in tmp_path.glob("*.json*")}
    count = r"1 of 3 episodes" if planned else r"1 episodes"
    with pytest.raises(
        OutputError, match=rf"unfinished \({count} are there\).*--resume {tmp_path}, or another"
    ):
        RunDirectory.create(tmp_path, RUN, planned)
    assert {path: path.read_bytes() for path in tmp_path.glob("*.json*")} == before


def test_a_run_that_came_to_no_episode_is_begun_anew_and_leaves_nothing_aside(tmp_path: Path) -> None:
    RunDirectory.create(tmp_path, RUN).close()
    RunDirectory.create(tmp_path, RUN).close()
    assert not list(tmp_path.glob("episodes.previous*"))


def without(row: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in row.items() if name != key}


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        (without(grasp_row(), "suite"), "missing required field `suite`"),
        (without(grasp_row(), "blind_drift_m"), "missing required field `blind_drift_m`"),
        (without(error_row(), "error"), "missing required field `error`"),
        (without(clearing_row(), "knocked_off"), "missing required field `knocked_off`"),
        (grasp_row(colour="red"), "unknown field `colour`"),
        (grasp_row(picks=[]), "missing required field"),
        (error_row(object="key"), "unknown field `object`"),
        (grasp_row(episode="0"), r"Expected `int`, got `str` - at `\$\.episode`"),
        (grasp_row(outcome="sucess"), r"Invalid enum value 'sucess' - at `\$\.outcome`"),
        (grasp_row(reflex={"limit": "force"}), r"missing required field `joint` - at `\$\.reflex`"),
        (clearing_row(picks=[{"outcome": "success"}]), r"missing required field .* - at `\$\.picks\[0\]`"),
    ],
)
@pytest.mark.parametrize("place", [0, 1])
def test_a_line_with_a_key_too_many_or_too_few_or_of_another_type_is_refused_by_file_and_number(
    tmp_path: Path, row: dict[str, Any], reason: str, place: int
) -> None:
    texts = [one_line(grasp_row())]
    texts.insert(place, one_line(row))
    (tmp_path / "episodes.jsonl").write_text("".join(texts))
    with pytest.raises(OutputError, match=rf"episodes\.jsonl, line {place + 1} is not .*{reason}"):
        read_lines(tmp_path)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "Expecting value"),
        ("not json", "Expecting value"),
        ("[]", "Expected `object`, got `array`"),
        ("{}", "missing required field `format`"),
        (json.dumps(run_row(format=2)), r"Invalid enum value 2 - at `\$\.format`"),
        (json.dumps(run_row(colour="red")), "unknown field `colour`"),
        (json.dumps(run_row(configuration_row(colour="red"))), r"`colour` - at `\$\.configuration`"),
        (json.dumps(run_row(configuration_row(suites=[]))), "missing required field `suite`"),
        (json.dumps(run_row(configuration_row(suite="paper", suites=[]))), "programme with `suites`"),
        (json.dumps(run_row(configuration_row(suite="paper"))), "programme with `suites`"),
    ],
)
def test_an_unusable_run_json_is_refused_by_name_and_reason(
    tmp_path: Path, content: str, reason: str
) -> None:
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(OutputError, match=rf"run\.json cannot be used.*{reason}"):
        read_run(tmp_path)
    with pytest.raises(OutputError, match=r"another run \(.*run\.json cannot be used"):
        RunDirectory.create(tmp_path, RUN)
    assert (tmp_path / "run.json").read_text() == content


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("{", "Expecting"),
        ('{"complete": true}', "missing required field `cells`"),
        ('{"complete": true, "cells": [], "paired_tests": [], "more": 1}', "unknown field `more`"),
        ('{"complete": true, "cells": [{"suite": "s"}], "paired_tests": []}', r"at `\$\.cells\[0\]`"),
    ],
)
def test_an_unusable_summary_is_refused_by_name_and_reason(tmp_path: Path, content: str, reason: str) -> None:
    assert read_summary(tmp_path) is None
    (tmp_path / "summary.json").write_text(content)
    with pytest.raises(OutputError, match=rf"summary\.json cannot be used.*{reason}"):
        read_summary(tmp_path)


def test_a_path_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        RunDirectory.create(tmp_path / "file", RUN)
    with pytest.raises(OutputError, match="cannot be written"):
        RunDirectory.create(tmp_path / "file" / "below", RUN)


def test_a_summary_that_cannot_be_written_is_an_output_error(tmp_path: Path) -> None:
    directory = RunDirectory.create(tmp_path / "run", RUN)
    (tmp_path / "run" / "summary.json").mkdir()
    with pytest.raises(OutputError, match=r"cannot be written.*run/summary\.json"):
        directory.write_summary(RunSummary(complete=True, cells=(), paired_tests=()))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_an_output_error(tmp_path: Path) -> None:
    directory = RunDirectory.create(tmp_path, RUN)
    directory._episodes = os.open("/dev/full", os.O_WRONLY)
    with pytest.raises(OutputError, match="No space left"):
        directory.append(LINE)
