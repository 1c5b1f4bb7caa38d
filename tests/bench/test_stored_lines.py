"""Laws of lines that stay in their file: they are those of a list, whatever the size of the file."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from bench_runs import clearing_row, error_row, grasp_row

from mpgrasp.bench import stored_lines
from mpgrasp.bench.record import ErrorLine, Line, Task, line_of, text_of
from mpgrasp.bench.stored_lines import StoredLines, by_cell, read_stored_lines


def some_lines(n: int = 60) -> list[Line]:
    """Lines of two cells, of all three kinds, some episodes twice or more."""
    rng = np.random.default_rng(3)
    lines = []
    for k in range(n):
        make = (grasp_row, clearing_row, error_row)[int(rng.integers(3))]
        controller = ("c", "other")[int(rng.integers(2))]
        row = make(episode=int(rng.integers(12)), controller=controller, scene_seed=k)
        lines.append(line_of(row))
    return lines


@pytest.fixture(params=["in memory", "on the disk"])
def stored(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StoredLines:
    """The lines of a file that is kept in memory, or read again for every line."""
    if request.param == "on the disk":
        monkeypatch.setattr(stored_lines, "IN_MEMORY", 0)
        monkeypatch.setattr(stored_lines, "_BLOCK", 700)  # so that lines go over its end
    file = tmp_path / "episodes.jsonl"
    file.write_text("".join(map(text_of, some_lines())), encoding="utf-8")
    lines, whole, other = read_stored_lines(file)
    assert (whole, other) == (file.stat().st_size, None)
    file.unlink()
    return lines


def test_they_are_a_sequence_of_what_was_written(stored: StoredLines) -> None:
    lines = some_lines()
    assert (list(stored), len(stored), stored[7], list(stored[5:9])) == (lines, 60, lines[7], lines[5:9])
    assert stored[-1] == lines[-1]
    assert list(stored.tasks()) == [line.task for line in lines]
    with pytest.raises(IndexError):
        stored[60]


def test_by_cell_they_are_as_those_of_a_list(stored: StoredLines) -> None:
    assert {cell: list(of_cell) for cell, of_cell in by_cell(stored).items()} == by_cell(some_lines())
    assert list(by_cell(stored)) == list(by_cell(some_lines()))


def test_of_an_episode_the_last_result_counts_or_else_the_first_error(stored: StoredLines) -> None:
    latest: dict[Task, Line] = {}
    for line in some_lines():
        if line.task not in latest or not isinstance(line, ErrorLine):
            latest[line.task] = line
    assert list(stored.latest()) == list(latest.values())
    assert len(latest) < 60
    assert any(isinstance(line, ErrorLine) for line in latest.values())
    results = {line.task for line in some_lines() if not isinstance(line, ErrorLine)}
    assert {task for task in latest if task in stored.played_tasks()} == results
    assert Task("elsewhere", 0, "d", "c") not in stored.played_tasks()


def test_they_are_put_into_any_order_of_their_episodes(stored: StoredLines) -> None:
    wanted = sorted(some_lines(), key=lambda line: (-line.episode, line.controller))
    found = stored.in_order(lambda task: (-task.episode, task.controller))
    assert list(found) == wanted


def test_a_file_that_takes_their_place_does_not_change_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored_lines, "IN_MEMORY", 0)
    file, new = tmp_path / "episodes.jsonl", tmp_path / "new"
    file.write_text("".join(map(text_of, some_lines())), encoding="utf-8")
    new.write_text("nothing of it\n" * 9, encoding="utf-8")
    lines, _, _ = read_stored_lines(file)
    os.replace(new, file)
    assert list(lines) == some_lines()


@pytest.mark.parametrize("last", [b"", b'{"a": 1}\n', b"\n", b'{"suite": "s'])
def test_they_end_before_the_first_text_that_is_no_line(tmp_path: Path, last: bytes) -> None:
    file, whole = tmp_path / "episodes.jsonl", text_of(line_of(grasp_row())).encode()
    file.write_bytes(whole + b"no line\n" + last)
    lines, size, other = read_stored_lines(file)
    assert (list(lines), size) == ([line_of(grasp_row())], len(whole))
    assert other == (2, b"no line\n", not last)


def test_of_an_empty_file_there_are_none(tmp_path: Path) -> None:
    (tmp_path / "episodes.jsonl").touch()
    lines, size, other = read_stored_lines(tmp_path / "episodes.jsonl")
    assert (list(lines.latest()), by_cell(lines), size, other) == ([], {}, 0, None)
    assert list(lines.in_order(lambda task: task)) == []


def test_files_are_closed_with_the_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored_lines, "IN_MEMORY", 0)
    file = tmp_path / "episodes.jsonl"
    file.write_text(text_of(line_of(grasp_row())), encoding="utf-8")
    before = len(os.listdir("/proc/self/fd"))
    kept = [read_stored_lines(file)[0] for _ in range(5)]
    assert len(os.listdir("/proc/self/fd")) == before + len(kept)
    kept.clear()
    assert len(os.listdir("/proc/self/fd")) == before
