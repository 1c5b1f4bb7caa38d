"""Laws of the one door: it leads to all commands, with their words, codes and errors."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from pathlib import Path

import pytest

import mpgrasp
from mpgrasp.__main__ import COMMANDS, main

PACKAGE = Path(mpgrasp.__file__).parent


def test_it_leads_to_every_package_that_is_a_command() -> None:
    assert set(COMMANDS) == {path.parent.name for path in PACKAGE.glob("*/__main__.py")}


def test_its_help_names_all_and_fits_eighty_columns(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == main([]) == 0
    said = capsys.readouterr().out
    assert all(f"  {name} " in said for name in COMMANDS)
    assert max(map(len, said.splitlines())) <= 80
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"mpgrasp {mpgrasp.__version__}\n"


@pytest.mark.parametrize("name", [*COMMANDS, "train", "generate"])
def test_a_command_gets_its_words(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = list(sys.argv)
    assert main([name, "--help"]) == 0
    assert capsys.readouterr().out.startswith("usage: python -m mpgrasp.")
    assert sys.argv == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["dance"], "unknown command; got 'dance'"),
        (["bench", "nowhere"], "unknown suite; got 'nowhere'"),
        (["evaluate", "cornell", "/nowhere"], "no such folder"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_exit_code_2(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_the_module_runs_too() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mpgrasp", "bench", "settings", "thin"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "gamma" in done.stdout


HELPS = [
    "", "bench", *(f"bench {word}" for word in (
        "compare", "export", "ladder", "ladders", "leaderboard", "merge", "plan", "profile", "race", "replay",
        "report", "settings", "sweep",
    )),
    "check", "check detector", "check controller", "detectors", "detectors show", "detectors check",
    "detectors card", "evaluate", "evaluate cornell", "evaluate jacquard", "evaluate synthetic", "offline",
    "scene", "training", "training generate", "training train", "training calibrate", "view",
]  # fmt: skip


@pytest.mark.parametrize("words", HELPS)
def test_every_help_fits_80_columns_and_begins_with_what_can_be_typed(
    words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with contextlib.suppress(SystemExit):
        main([*words.split(), "--help"])
    said = capsys.readouterr().out
    assert said.startswith("usage: ")
    assert not [line for line in said.splitlines() if len(line) > 80]
