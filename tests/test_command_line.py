"""Laws of command lines: what is wrong is one line, in the same words from all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

from mpgrasp.bench import __main__ as bench
from mpgrasp.command_line import Parser, run_command
from mpgrasp.detectors import __main__ as detectors
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.scene import __main__ as scene_command
from mpgrasp.training import __main__ as training


@pytest.mark.parametrize(
    ("main", "words"),
    [
        (bench.main, ["thin"]),
        (bench.main, ["compare", "a", "b"]),
        (training.main, ["generate", "--out", "a"]),
        (training.main, ["train", "dhrnet", "--data", "a"]),
        (detectors.main, ["show", "dhrnet"]),
        (scene_command.main, ["thin"]),
    ],
)
def test_every_command_refuses_an_unknown_option_in_the_same_words(
    main: Callable[[Sequence[str]], int], words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "--bogus"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("mpgrasp: error: unrecognized arguments: --bogus; allowed: see python -m ")
    assert printed.err.endswith("--help\n")
    assert printed.err.count("\n") == 1


def test_an_error_of_several_lines_is_told_in_one(capsys: pytest.CaptureFixture[str]) -> None:
    def fail() -> int:
        raise OutputError("disk\nfull", allowed="a larger\none")

    assert run_command(fail) == 2
    assert capsys.readouterr().err == "mpgrasp: error: disk full; allowed: a larger one\n"


def test_the_exit_code_is_the_command_s_own_or_130_for_ctrl_c() -> None:
    def interrupted() -> int:
        raise KeyboardInterrupt

    assert [run_command(lambda code=code: code) for code in (0, 1, 7)] == [0, 1, 7]  # type: ignore[misc]
    assert run_command(interrupted) == 130


def test_what_is_no_error_of_ours_is_not_swallowed() -> None:
    with pytest.raises(ZeroDivisionError):
        run_command(lambda: 1 // 0)


def test_subcommands_complain_like_their_command() -> None:
    parser = Parser(prog="tool")
    parser.add_subparsers(dest="command").add_parser("part").add_argument("--n", type=int)
    with pytest.raises(ConfigError, match=r"argument --n: unusable number; got 'x'; allowed: a whole one$"):
        parser.parse_args(["part", "--n", "x"])
