"""`python -m mpgrasp.bench ladders`: all ladders, one after the other, and one report on them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from mpgrasp.bench.commands import ladder
from mpgrasp.bench.ladders.declaration import ladder_names
from mpgrasp.bench.results.reader import RUN
from mpgrasp.exceptions import ConfigError

_EPILOG = """\
examples:
  python -m mpgrasp.bench ladders --detector dhrnet --controller mppc_robust
  python -m mpgrasp.bench ladders thickness,cloth --detector my_net:MyDetector --out mine

Takes the options of `ladder`. Each ladder is a run of its own, in a folder of --out that has its name; the
report on all of them is in --out. The same command with the same --out goes on where it was interrupted.
"""


def make_parser() -> argparse.ArgumentParser:
    """The command line's options: those of a ladder."""
    parser = ladder.make_parser()
    parser.prog = "python -m mpgrasp.bench ladders"
    parser.description = "Climb all ladders, or those that are named with commas between them."
    parser.epilog = _EPILOG
    return parser


def main(command: Sequence[str]) -> int:
    """Climb the ladders, write the report and return the worst exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    arguments = make_parser().parse_args(command)
    if arguments.resume is not None:
        raise ConfigError("ladders with --resume", got=str(arguments.resume), allowed="the same --out")
    names = arguments.suite.split(",") if arguments.suite else ladder_names()
    known = ladder_names()
    if not set(names) <= set(known):
        raise ConfigError("unknown ladder", got=arguments.suite, allowed=known)
    out = arguments.out or Path("runs") / f"ladders-{datetime.now():%Y%m%d-%H%M%S}"
    words = _without(command, arguments.suite, "--out")
    code = 0
    for name in names:
        folder = out / name
        begun = (folder / RUN).is_file()
        where = ["--resume", str(folder)] if begun else ["--out", str(folder)]
        code = max(code, ladder.main([name, *words, *where]))
        if code > 1:
            return code
    from mpgrasp.bench.report.build import write_report

    print(f"Report on all: {write_report([out / name for name in names], out)}")
    return code


def _without(command: Sequence[str], suite: str | None, option: str) -> list[str]:
    """Words of a command without its suite and without an option and its value."""
    words, left = iter(command), []
    for word in words:
        if word == option:
            next(words, None)
        elif word.startswith(f"{option}="):
            continue
        elif word == suite:
            suite = None
        else:
            left.append(word)
    return left
