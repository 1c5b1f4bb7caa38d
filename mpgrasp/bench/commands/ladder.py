"""`python -m mpgrasp.bench ladder NAME`: how hard a suite may get before a method fails."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from mpgrasp.bench.commands.run import make_parser as run_parser
from mpgrasp.bench.commands.run import parse
from mpgrasp.bench.playing.recorded_command import LADDER
from mpgrasp.exceptions import ConfigError

_EPILOG = """\
examples:
  python -m mpgrasp.bench ladder thickness
  python -m mpgrasp.bench ladder cloth --detector dhrnet,ggcnn,oracle --controller mppc_robust --workers 2
  python -m mpgrasp.bench ladder thickness --detector my_net:MyDetector --episodes 120

NAME is one of benchmarks/ladders/, or a path to a declaration.toml. Every method plays --episodes in all
(default: 200): first a few at rungs over the whole ladder, then at those where its own results tell most
about the levels at which its success falls to 90 and to 50 %. What comes out are these levels with 95 %
intervals, and for every two methods whether they differ, over the same worlds.

All else is as for a run, --resume, replay and report included; a rung is a suite called 'NAME[UNIT=X]'.
"""


def make_parser() -> argparse.ArgumentParser:
    """The command line's options: those of a run."""
    parser = run_parser()
    parser.prog = "python -m mpgrasp.bench ladder"
    parser.description = "Climb a ladder: find how hard a suite may get before a method fails."
    parser.epilog = _EPILOG
    parser.set_defaults(ladder=True)
    return parser


def main(command: Sequence[str]) -> int:
    """Climb the ladder and return the exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    arguments = parse(command, make_parser())
    if not arguments.ladder:
        raise ConfigError("the run that is to be resumed is no ladder", got=str(arguments.resume))
    from mpgrasp.bench.playing.run import run

    return run(arguments, [LADDER, *command])
