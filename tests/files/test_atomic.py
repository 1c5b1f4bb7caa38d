from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mpgrasp.files.atomic import replace_file


@pytest.mark.parametrize("content", ["zwölf\n", b"\x00\xff", ""])
def test_a_file_holds_what_was_written_last_and_nothing_lies_beside_it(
    tmp_path: Path, content: str | bytes
) -> None:
    file = tmp_path / "a.json"
    for something in ("before, and longer than what comes after", content):
        replace_file(file, something)
    assert file.read_bytes() == (content if isinstance(content, bytes) else content.encode("utf-8"))
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_what_cannot_be_written_leaves_the_old_content_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    file = tmp_path / "a"
    replace_file(file, "old")
    monkeypatch.setattr(os, step, full)
    with pytest.raises(OSError, match="No space left"):
        replace_file(file, "new")
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_content_is_on_the_disk_before_it_takes_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []

    def noted(name: str) -> Callable[..., None]:
        real = getattr(os, name)

        def step(*args: Any) -> None:
            steps.append(name)
            real(*args)

        return step

    for name in ("fsync", "replace"):
        monkeypatch.setattr(os, name, noted(name))
    replace_file(tmp_path / "a", "new")
    assert steps[:2] == ["fsync", "replace"]


def test_files_are_as_readable_as_any_other(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    replace_file(tmp_path / "replaced", "")
    assert (tmp_path / "replaced").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_writers_at_the_same_time_leave_the_whole_content_of_one(tmp_path: Path) -> None:
    file, contents = tmp_path / "a", [letter * 100_000 for letter in "abcd"]
    threads = [threading.Thread(target=replace_file, args=(file, content)) for content in contents]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert file.read_text() in contents
    assert list(tmp_path.iterdir()) == [file]
