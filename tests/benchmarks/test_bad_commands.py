"""No command line that makes no sense is begun: one line says why, at once, and nothing is written."""

from __future__ import annotations

import importlib
import subprocess
import time
from ctypes.util import find_library
from pathlib import Path

import bad_commands
import pytest
from bad_commands import BAD_COMMANDS, PACKAGES, BadCommand, prepare

AT_ONCE = 30.0
"""Processor time that a command may take with all that it imports [s]; it is next to none."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("commands")
    prepare(made)
    return made


PUBLISHED = [Path(bad_commands.HERE) / "results", Path(bad_commands.HERE).parent / "docs"]
"""Folders that studies write to unless told otherwise."""


def content(*folders: Path) -> dict[str, int]:
    files = (path for folder in folders for path in folder.rglob("*") if path.is_file())
    return {str(path): path.stat().st_mtime_ns for path in files if "suites" not in path.parts}


@pytest.fixture
def nothing_is_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line that is taken after all does not play for hours, nor compile a network first."""

    def begun(*_: object, **__: object) -> None:
        raise AssertionError("the command was taken, and its work begun")

    monkeypatch.setattr("mpgrasp.bench.playing.run.make_crew", begun)
    monkeypatch.setattr("mpgrasp.bench.playing.player.Player.prepare", lambda _: [])
    monkeypatch.setattr("mpgrasp.bench.playing.player.Player.play", begun)


@pytest.mark.parametrize("bad", BAD_COMMANDS.values(), ids=BAD_COMMANDS)
def test_a_bad_command_ends_at_once_with_one_line_and_2(
    bad: BadCommand,
    folder: Path,
    nothing_is_begun: None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if bad.environment.get("MUJOCO_GL") == "osmesa" and find_library("OSMesa"):
        pytest.skip("OSMesa is there")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPGRASP_CACHE", str(folder / "suites" / "cache"))
    for name, value in bad.environment.items():
        monkeypatch.setenv(name, value)
    before, start = content(folder, *PUBLISHED), time.process_time()
    module = f"mpgrasp.{bad.program}.__main__" if bad.program in PACKAGES else bad.program
    code = importlib.import_module(module).main(bad.arguments)
    printed = capsys.readouterr()
    assert code == 2
    assert printed.out == ""
    assert printed.err.startswith("mpgrasp: error: ")
    assert printed.err.count("\n") == 1
    assert bad.said in printed.err
    assert len(printed.err) < 1000
    assert printed.err.rstrip("\n").isprintable()
    assert content(folder, *PUBLISHED) == before
    assert time.process_time() - start < AT_ONCE


def test_there_are_many() -> None:
    assert len(BAD_COMMANDS) >= 150
    assert {bad.program for bad in BAD_COMMANDS.values()} > set(PACKAGES)


@pytest.mark.parametrize("line", ["bench thin --episodes 0", "table --bogus", "MUJOCO_GL=banana scene thin"])
def test_a_process_says_the_same(
    line: str, folder: Path, monkeypatch: pytest.MonkeyPatch, environment: dict[str, str]
) -> None:
    bad = BAD_COMMANDS[line]
    done = subprocess.run(
        bad.argv(), env={**environment, **bad.environment}, cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert bad.said in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.fixture
def environment() -> dict[str, str]:
    import os

    import mpgrasp

    return {**os.environ, "PYTHONPATH": str(Path(mpgrasp.__file__).parents[1])}
