"""The command that a run was made with, read back from its run.json, and its files found again.

run.json keeps a command as it was typed. A path in it that is not there from the present directory is looked
for from the folders above the run, of which the directory that it was typed in usually is one.
"""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from mpgrasp.bench.meshes.files import YCB
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.run_card import RunDescription
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.plugin_names import WEIGHTS, method_of

PROGRAM = ("python", "-m", "mpgrasp.bench")
"""First words of a recorded command."""
SWEEP, LADDER, RACE = "sweep", "ladder", "race"
"""Words before the others that make a run a sweep, one of a ladder, or a race."""


class CommandParser(Protocol):
    """Reader of a run's command line."""

    prog: str

    def parse_args(self, words: Sequence[str], /) -> Namespace:
        """Return the arguments that words mean."""
        ...


def recorded_arguments(folder: Path, parser: CommandParser, more: Sequence[str] = ()) -> Namespace:
    """Arguments of the command that a run was made with, with paths that lead to its files from here.

    Args:
        folder: of the run.
        parser: of such commands.
        more: words behind those of the command; `--weights` and `--objects` among them take the place
            of the command's own.

    Raises:
        ConfigError: words that cannot be used, or a file that cannot be found.
        OutputError: no run there, or it does not say by which command it was made.
    """
    words = _command_of(read_run(folder), folder)
    kind = words[0] if words and words[0] in (SWEEP, LADDER, RACE) else ""
    words = words[bool(kind) :]
    if (kind == RACE) != hasattr(parser, "race"):
        raise ConfigError(
            "a race is resumed as a race, and nothing else is", got=str(folder), allowed="race --resume DIR"
        )
    before, added = parser.parse_args(words), parser.parse_args(more)
    arguments = parser.parse_args([*words, *more])
    arguments.sweep, arguments.ladder = kind == SWEEP, kind == LADDER
    if arguments.suite is None:
        raise _no_command(folder)
    if arguments.suite.endswith(".toml"):
        arguments.suite = _find(arguments.suite, folder)
    if arguments.detector is not None:
        arguments.detector = ",".join(_find_plug_in(word, folder) for word in arguments.detector.split(","))
    if arguments.controller is not None:
        arguments.controller = ",".join(
            _find_plug_in(word, folder) for word in arguments.controller.split(",")
        )
    if getattr(arguments, "race", ()):
        arguments.race = tuple(
            "/".join(_find_plug_in(word, folder) for word in method_of(name)) for name in arguments.race
        )
    arguments.weights = added.weights or [_find_weights(text, folder) for text in before.weights]
    arguments.objects = added.objects or [
        word if word == YCB else _find(word, folder) for word in before.objects
    ]
    return arguments


def _command_of(run: RunDescription, folder: Path) -> list[str]:
    """Arguments of the command that a run was made with."""
    try:
        words = shlex.split(run.command)
    except ValueError as error:
        raise _no_command(folder) from error
    return words[len(PROGRAM) :]


def _no_command(folder: Path) -> OutputError:
    return OutputError(
        "run.json does not say by which command it was made", got=str(folder), allowed="`command`"
    )


def _find_weights(text: str, folder: Path) -> str:
    """FILE, or DETECTOR=FILE, with a path that leads to the file."""
    name, separator, file = text.partition("=")
    if separator and not _places(text, folder):
        return f"{name}={_find(file, folder)}"
    return _find(text, folder)


def _find_plug_in(name: str, folder: Path) -> str:
    """A detector or controller with a path that leads to its file, or to its weights; others as they are."""
    file, colon, attribute = name.rpartition(":")
    if file.endswith(".py"):
        return f"{_find(file, folder)}{colon}{attribute}"
    network, at, weights = name.partition(WEIGHTS)
    return f"{network}{at}{_find(weights, folder)}" if at else name


def _find(path: str, folder: Path) -> str:
    places = _places(path, folder)
    if not places:
        raise ConfigError(
            "a file that the run was made with is not there any more",
            got=path,
            allowed=f"that path from this directory or from one above {folder}; where weights are now, "
            "--weights can say",
        )
    return places[0]


def _places(path: str, folder: Path) -> list[str]:
    """Paths that lead to something: as typed, then from the folders above the run, nearest first."""
    above = [str(parent / path) for parent in folder.absolute().parents]
    return [place for place in (path, *above) if Path(place).exists()]
