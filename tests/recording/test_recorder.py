"""Laws of recorders: where they may write, and in what order they are told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mpgrasp.exceptions import OutputError
from mpgrasp.recording.film import FilmRecorder
from mpgrasp.recording.recorder import NullRecorder, TeeRecorder, claim_file
from mpgrasp.recording.rerun import RerunRecorder


@pytest.mark.parametrize(
    ("make", "name"),
    [(RerunRecorder, "a.rrd"), (FilmRecorder, "a.gif")],
)
def test_places_that_cannot_be_written_are_refused_before_the_episode(
    make: Callable[[Path], Any], name: str, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        make(tmp_path / "file" / name)
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match="cannot be written"):
        make(tmp_path / name)
    with pytest.raises(OutputError, match="unknown kind"):
        make(tmp_path / "a.xyz")


def test_claiming_a_file_makes_its_directory_and_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    file = claim_file(tmp_path / "a" / "b" / "c.RRD", (".rrd",))
    assert file.parent.is_dir()
    assert not file.exists()
    file.write_text("of an earlier run")
    claim_file(file, (".rrd",))
    assert file.read_text() == "of an earlier run"


def test_tee_tells_all_in_order() -> None:
    told: list[str] = []

    class Listener(NullRecorder):
        def __init__(self, name: str) -> None:
            self.name = name

        def finish(self, event: str) -> None:
            told.append(self.name + event)

    TeeRecorder(Listener("a"), Listener("b")).finish("!")
    assert told == ["a!", "b!"]
