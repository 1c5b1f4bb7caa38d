"""Laws of reading files that anybody may name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from mpgrasp.files.regular import read_regular


def test_a_file_up_to_the_limit_is_read(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"x" * 1000)
    assert read_regular(file, 0.001) == b"x" * 1000
    file.write_bytes(b"x" * 1001)
    with pytest.raises(OSError, match="more than") as caught:
        read_regular(file, 0.001)
    assert caught.value.strerror


def test_what_may_never_end_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name in ("fifo", "zero"):
        with pytest.raises(OSError, match="no regular file"):
            read_regular(tmp_path / name, 1.0)


@pytest.mark.parametrize(
    ("name", "reason"), [("", "directory"), ("gone", "No such file"), ("x" * 300, "too long"), ("\0", "null")]
)
def test_what_is_no_file_is_refused_with_its_reason(tmp_path: Path, name: str, reason: str) -> None:
    with pytest.raises(OSError, match=reason) as caught:
        read_regular(tmp_path / name, 1.0)
    assert caught.value.strerror
