"""The benchmark's command line: `python -m mpgrasp.bench SUITE ...`, and other commands."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence

from mpgrasp.bench.commands.run import parse
from mpgrasp.command_line import run_command

SUBCOMMANDS = (
    "compare", "export", "ladder", "ladders", "leaderboard", "merge", "plan", "profile", "race", "replay",
    "report", "settings", "sweep",
)  # fmt: skip
"""Words in the place of SUITE, each in its own module."""


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    # before numpy and torch are loaded: results must not depend on how many cores there are
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    words = sys.argv[1:] if command is None else command
    return run_command(lambda: _run(words))


def _run(command: Sequence[str]) -> int:
    if command and command[0] in SUBCOMMANDS:
        module = importlib.import_module(f"mpgrasp.bench.commands.{command[0]}")
        code: int = module.main(command[1:])
        return code
    arguments = parse(command)
    from mpgrasp.bench.playing.run import run

    return run(arguments, command)


if __name__ == "__main__":
    sys.exit(main())
