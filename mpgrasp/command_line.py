"""Parts that all command lines share: a parser that raises, errors as one line, and exit codes."""

from __future__ import annotations

import argparse
import itertools
import math
import os
import re
import sys
import textwrap
from collections.abc import Callable
from ctypes.util import find_library
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from mpgrasp.exceptions import ConfigError, MpgraspError
from mpgrasp.extras import missing_library, not_installed
from mpgrasp.names import printable

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_PIPE = 2, 130, 141

GL_BACKENDS = ("", "egl", "osmesa", "glfw", "glx", "wgl", "cgl", "enable", "enabled", "on", "true", "1",
               "disable", "disabled", "off", "false", "0")  # fmt: skip
"""Values of MUJOCO_GL that MuJoCo takes."""
MOST_UNTIL_CI = 1000
"""Episodes after which a run that waits for narrow intervals, or a race, ends unless told otherwise."""
MOST_EPISODES = 1_000_000
"""Most episodes of each combination: days of work for a hundred cores."""
LARGEST = 2**63 - 1
"""Largest whole number of an option."""


_TIE = "\N{NO-BREAK SPACE}"  # between an option and its value


class HelpText(argparse.HelpFormatter):
    """Fills paragraphs to the width of the terminal, 80 columns where there is none.

    Lines that are set in keep to themselves: examples and tables. What is too long of a command goes on in
    the next line, as a shell takes it, and no option is parted from its value.
    """

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        lines: list[str] = []
        for apart, group in itertools.groupby(text.splitlines(), lambda line: not line or line[0] == " "):
            if apart:
                for line in group:
                    lines += _fitted(line, width)
            else:
                lines += textwrap.wrap(" ".join(group), width)
        return "\n".join(indent + line for line in lines)


def _fitted(line: str, width: int) -> list[str]:
    """Return a line that is set in as lines of a width; a command with a backslash where it is broken."""
    if len(line) <= width:
        return [line]
    margin = line[: len(line) - len(line.lstrip())]
    command = line.lstrip().startswith("python ")
    parts = textwrap.wrap(
        re.sub(r"(?<= )(--?[a-z][\w-]*) (?=[^-\s])", rf"\1{_TIE}", line.strip()) if command else line.strip(),
        width - len(margin) - 2,
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    end = " \\" if command else ""
    parts = [part.replace(_TIE, " ") for part in parts]
    return [margin + part + (end if k + 1 < len(parts) else "") for k, part in enumerate(parts)]


class Parser(argparse.ArgumentParser):
    """Raises ConfigError where argparse would print its usage and exit.

    Options of `type=int`, `float` and `Path` take numbers and names that a program can do something with:
    whole ones of 64 bits, finite ones, and paths that are not empty.
    """

    def __init__(self, **settings: Any) -> None:
        super().__init__(**{"formatter_class": HelpText, **settings})
        for kind, read in ((int, whole(-LARGEST, LARGEST)), (float, number(-1e12, 1e12)), (Path, _path)):
            self.register("type", kind, read)

    def error(self, message: str) -> NoReturn:
        raise ConfigError(message, allowed=None if "; allowed: " in message else f"see {self.prog} --help")

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help; OSError where it cannot be written, which argparse would keep to itself."""
        (file or sys.stdout).write(self.format_help())


def whole(low: int, high: int) -> Callable[[str], int]:
    """Return a reader of whole numbers from low to high, for the `type` of an option."""

    def read(text: str) -> int:
        try:
            value = int(text) if len(text) < 100 else None
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            words = f"{low} to {high}" if high < LARGEST else f"{low} or more" if low >= 0 else "a whole one"
            raise argparse.ArgumentTypeError(f"unusable number; got {text[:40]!r}; allowed: {words}")
        return value

    return read


def number(low: float, high: float, unit: str = "", *, above: bool = False) -> Callable[[str], float]:
    """Return a reader of numbers from low to high, for the `type` of an option; `above`: more than low."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (low < value if above else low <= value) or not value <= high:
            words = f"{'more than ' if above else ''}{low:g} to {high:g}{f' {unit}' if unit else ''}"
            raise argparse.ArgumentTypeError(f"unusable number; got {text[:40]!r}; allowed: {words}")
        return value

    return read


COUNT = whole(1, MOST_EPISODES)
"""Type of an option that takes a number of episodes, scenes or the like."""
EPISODE = whole(0, MOST_EPISODES - 1)
"""Type of an option that takes the number of an episode."""
SEED = whole(0, LARGEST)
"""Type of an option that takes a seed."""
WORKERS = whole(0, 256)
"""Type of an option that takes a number of processes, 0 for this one."""
THREADS = whole(1, 256)
"""Type of an option that takes a number of threads, or of processes that there must be."""


def _path(text: str) -> Path:
    if not text.strip() or "\0" in text:
        raise argparse.ArgumentTypeError(f"unusable path; got {text!r}; allowed: a name, or . for here")
    return Path(text)


def run_command(command: Callable[[], int]) -> int:
    """Run a command and return its exit code: its own, 2 and one line for unusable input, 130 for Ctrl-C.

    A library that is not installed, and what the system refuses, such as a name that is too long or a full
    disk under standard output, are unusable input too. A pipe that nobody reads any more ends it silently,
    with 141.
    """
    try:
        check_gl()
        try:
            code = command()
        except SystemExit:  # after `--help`
            sys.stdout.flush()
            raise
        sys.stdout.flush()
    except MpgraspError as error:
        print_error(error)
        return EXIT_BAD_INPUT
    except ModuleNotFoundError as error:
        library = missing_library(error)
        if library is None:
            raise
        print_error(not_installed(library, "this"))
        return EXIT_BAD_INPUT
    except BrokenPipeError:  # whoever reads our output, such as `head`, has had enough
        _give_up(sys.stdout)
        return EXIT_PIPE
    except OSError as error:
        _give_up(sys.stdout)
        where = "" if error.filename is None else f"; got {error.filename!r}"
        print_error(MpgraspError(f"the system refused: {error.strerror or error}{where}"))
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    return code


def check_gl() -> None:
    """Raise ConfigError where MUJOCO_GL is such that MuJoCo could not even be imported."""
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked not in GL_BACKENDS:
        raise ConfigError(
            "unusable environment variable MUJOCO_GL", got=asked, allowed="egl, osmesa, glfw, or unset"
        )
    if asked == "osmesa" and not any(map(find_library, ("OSMesa", "OSMesa.so.8"))):
        raise ConfigError(
            "MUJOCO_GL asks for OSMesa, which is not installed",
            got=asked,
            allowed="egl or unset, or install libosmesa6; the camera can ray-cast with MUJOCO_GL=disable",
        )


def _give_up(stream: TextIO) -> None:
    """Keep the interpreter from complaining, at its end, about what a standard stream did not take."""
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def print_error(error: MpgraspError) -> None:
    """Say on stderr, in one line, what is wrong; where nobody can read it, the exit code alone says it."""
    try:
        print("mpgrasp: error:", printable(" ".join(str(error).splitlines())), file=sys.stderr, flush=True)
    except OSError:
        _give_up(sys.stderr)
