"""Parts that all command lines share: a parser that raises, errors as one line, and exit codes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import NoReturn

from mpgrasp.exceptions import ConfigError, MpgraspError

EXIT_BAD_INPUT, EXIT_INTERRUPTED = 2, 130


class Parser(argparse.ArgumentParser):
    """Raises ConfigError where argparse would print its usage and exit."""

    def error(self, message: str) -> NoReturn:
        raise ConfigError(message, allowed=f"see {self.prog} --help")


def run_command(command: Callable[[], int]) -> int:
    """Run a command and return its exit code: its own, 2 and one line for unusable input, 130 for Ctrl-C."""
    try:
        return command()
    except MpgraspError as error:
        print_error(error)
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED


def print_error(error: MpgraspError) -> None:
    """Say on stderr, in one line, what is wrong."""
    print("mpgrasp: error:", " ".join(str(error).splitlines()), file=sys.stderr)
