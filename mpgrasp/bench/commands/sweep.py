"""`python -m mpgrasp.bench sweep SUITE --set ...`: plays a grid of settings as one run."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from mpgrasp.bench.commands.run import make_parser as run_parser
from mpgrasp.bench.commands.run import parse
from mpgrasp.bench.playing.recorded_command import SWEEP
from mpgrasp.exceptions import ConfigError

_EPILOG = """\
examples:
  python -m mpgrasp.bench sweep thin --set controller.gamma=0,4/3,8 --set controller.alpha=0.2,1
  python -m mpgrasp.bench sweep thin --detector dhrnet,oracle --set sensor.subpixel=0.04,0.08,0.16
  python -m mpgrasp.bench sweep stacked --set 'scene.jitter=[0, 0],[0.003, 0.05]' --set ik.damping=1e-6

A value may be whatever --set of a run takes, and several have commas between them; a setting with one value
holds for all. Every value is played with every other, up to 1024 points. A point is a suite of its own,
called SUITE[KEY=VALUE,...], over the same worlds as the suite: points are compared episode by episode. Each
point is tested against the one that has the suite's own values, or else against the first.

All else is as for a run, --resume, compare, replay and report included; a cell is called
'SUITE[KEY=VALUE,...]/DETECTOR/CONTROLLER'.
"""


def make_parser() -> argparse.ArgumentParser:
    """The command line's options: those of a run."""
    parser = run_parser()
    parser.prog = "python -m mpgrasp.bench sweep"
    parser.description = "Play every combination of some values of settings, and report them side by side."
    parser.epilog = _EPILOG
    parser.set_defaults(sweep=True)
    return parser


def main(command: Sequence[str]) -> int:
    """Play the sweep and return the exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    arguments = parse(command, make_parser())
    if not arguments.sweep:
        raise ConfigError("the run that is to be resumed is no sweep", got=str(arguments.resume))
    from mpgrasp.bench.playing.run import run

    return run(arguments, [SWEEP, *command])
