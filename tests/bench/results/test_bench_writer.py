from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from mpgrasp.bench.analysis.summary import paired_tests, summarise
from mpgrasp.bench.results.reader import read_lines
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.exceptions import OutputError
from mpgrasp.files.json_values import one_line

RUN = {"configuration": {"suite": {}, "seed": 0}}
WHICH = {"suite": "thin", "episode": 0, "detector": "d", "controller": "c"}
LINE = {**WHICH, "seed": 0, "scene_seed": 1, "outcome": "success", "success": True}
LINE |= {"object": "key", "sim_time_s": 5.0, "reflex": None, "state_hash": "0"}


def test_a_run_directory_holds_every_line_at_once(tmp_path: Path) -> None:
    directory = RunDirectory.create(tmp_path / "a" / "b", RUN)
    for k in range(3):
        directory.append({**LINE, "episode": k, "x": np.float64(1 / 3), "nan": float("nan")})
        assert len(directory.episodes_file.read_bytes().splitlines()) == k + 1
    assert directory.episodes()[0] == {**LINE, "episode": 0, "x": 0.333333333, "nan": None}
    directory.write_summary({"complete": True, "cells": [{"n": 3}]})
    assert json.loads((directory.path / "summary.json").read_text()) == {
        "complete": True,
        "cells": [{"n": 3}],
    }


def test_a_directory_with_another_run_is_refused_and_left_alone(tmp_path: Path) -> None:
    first = RunDirectory.create(tmp_path, RUN)
    first.append({"episode": 0})
    first.close()
    before = {path: path.read_bytes() for path in tmp_path.glob("*.json*")}
    with pytest.raises(OutputError, match=r"another run \(seed: 0 there, 1 here\)"):
        RunDirectory.create(tmp_path, {"configuration": {"suite": {}, "seed": 1}})
    assert {path: path.read_bytes() for path in tmp_path.glob("*.json*")} == before


def test_a_complete_run_again_starts_afresh_and_keeps_the_lines_of_every_time(tmp_path: Path) -> None:
    for k in range(3):
        directory = RunDirectory.create(tmp_path, RUN)
        assert directory.episodes() == []
        directory.append({**LINE, "sim_time_s": float(k)})
        directory.write_summary({"complete": True})
        directory.close()
    kept = {
        file.name: json.loads(file.read_text())["sim_time_s"] for file in tmp_path.glob("episodes*.jsonl")
    }
    assert kept == {
        "episodes.previous.jsonl": 0.0,
        "episodes.previous-2.jsonl": 1.0,
        "episodes.jsonl": 2.0,
    }


@pytest.mark.parametrize("summary", [None, '{"complete": false}', "{", "[]"])
@pytest.mark.parametrize("planned", [3, None])
def test_an_unfinished_run_is_not_begun_anew(
    tmp_path: Path, summary: str | None, planned: int | None
) -> None:
    first = RunDirectory.create(tmp_path, RUN)
    first.append(LINE)
    first.append({**LINE, "episode": 1, "outcome": "error", "error": "a bug", "traceback": "..."})
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


@pytest.mark.parametrize(
    ("line", "lacking"),
    [
        (WHICH, "seed, scene_seed, outcome, success, object, sim_time_s, reflex, state_hash"),
        ({key: item for key, item in LINE.items() if key != "success"}, "success"),
        ({key: item for key, item in LINE.items() if key != "state_hash"}, "state_hash"),
        ({**LINE, "outcome": "error"}, "error"),
        ({**LINE, "picks": []}, "failures, in_basket, knocked_off, left"),
    ],
)
@pytest.mark.parametrize("place", [0, 1])
def test_a_line_without_a_key_that_all_have_is_refused_by_file_number_and_key(
    tmp_path: Path, line: dict, lacking: str, place: int
) -> None:
    texts = [one_line(LINE)]
    texts.insert(place, one_line(line))
    (tmp_path / "episodes.jsonl").write_text("".join(texts))
    with pytest.raises(OutputError, match=rf"episodes\.jsonl, line {place + 1} .*: it lacks {lacking}; got"):
        read_lines(tmp_path)


def test_a_line_with_these_keys_alone_is_enough_for_tables_and_pairs(tmp_path: Path) -> None:
    error = {**WHICH, "episode": 1, "seed": 0, "scene_seed": 2, "outcome": "error", "success": None}
    texts = [one_line(line) for line in (LINE, {**error, "error": "a bug"})]
    (tmp_path / "episodes.jsonl").write_text("".join(texts))
    lines = read_lines(tmp_path).lines
    (cell,) = summarise(lines)
    assert (cell["n"], cell["errors"], cell["successes"]) == (1, 1, 1)
    assert paired_tests([*lines, {**LINE, "controller": "other"}])[0]["n"] == 1


@pytest.mark.parametrize("content", ["", "[]", "{}", "not json"])
def test_a_directory_with_an_unreadable_run_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(OutputError, match=r"run\.json cannot be read"):
        RunDirectory.create(tmp_path, RUN)


def test_a_path_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        RunDirectory.create(tmp_path / "file", RUN)
    with pytest.raises(OutputError, match="cannot be written"):
        RunDirectory.create(tmp_path / "file" / "below", RUN)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_an_output_error(tmp_path: Path) -> None:
    directory = RunDirectory.create(tmp_path, RUN)
    directory._episodes = os.open("/dev/full", os.O_WRONLY)
    with pytest.raises(OutputError, match="No space left"):
        directory.append({"episode": 0})
