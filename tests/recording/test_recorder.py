"""Laws of recorders: where they may write, and in what order they are told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mpgrasp.exceptions import OutputError
from mpgrasp.recording.film import FilmRecorder
from mpgrasp.recording.recorder import LenientRecorder, NullRecorder, TeeRecorder, claim_file
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


class Failing(NullRecorder):
    """Fails to write in one of its calls, and remembers them all."""

    def __init__(self, fails_in: str) -> None:
        self.fails_in, self.calls = fails_in, list[str]()
        self._call("init")

    def _call(self, name: str) -> None:
        self.calls.append(name)
        if name == self.fails_in:
            raise OutputError(f"no room to {name}")

    def start(self, simulation: Any) -> None:
        self._call("start")

    def tick(self, record: Any) -> None:
        self._call("tick")

    def finish(self, event: str) -> None:
        self._call("finish")


@pytest.mark.parametrize(
    ("fails_in", "called"),
    [
        ("init", []),
        ("start", ["init", "start"]),
        ("tick", ["init", "start", "tick"]),
        ("finish", ["init", "start", "tick", "tick", "finish"]),
    ],
)
def test_an_episode_goes_on_without_a_recorder_that_fails(fails_in: str, called: list[str]) -> None:
    made: list[Failing] = []
    lost: list[OutputError] = []

    def make() -> Failing:
        made.append(Failing(fails_in))
        return made[-1]

    recorder = LenientRecorder(make, lost.append)
    record: Any = None
    recorder.start(record)
    recorder.tick(record)
    recorder.tick(record)
    recorder.finish("success")
    assert [str(error) for error in lost] == [f"no room to {fails_in}"]
    assert [call for one in made for call in one.calls] == called


def test_a_fault_of_a_recorder_s_own_is_not_taken_for_a_full_disk() -> None:
    def broken() -> NullRecorder:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        LenientRecorder(broken, lambda _: None)
