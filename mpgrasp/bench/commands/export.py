"""`python -m mpgrasp.bench export RUN --out DIR`: episodes of a run as data to learn from."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from mpgrasp.command_line import COUNT, Parser

FORMATS = ("npz", "hdf5", "lerobot")
"""Kinds of files."""

_EPILOG = """\
The episodes are played again, in this process, by the command that the run was made with: every one must come
out bit for bit as in the run, or it is left out and told. Of each the reach is written, a row for every
control tick: depth and quality 224 x 224, tool and joints as seen, and what the controller asked for, as
actions of the Gymnasium environment (mpgrasp.env). The last tick has the reward: 1 for a success.

  npz      demo_000000.npz and so on, index.json
  hdf5     demonstrations.hdf5, as robomimic reads it      (pip install mpgrasp[export])
  lerobot  a LeRobotDataset, version 3                     (pip install mpgrasp[export])

exit code: 0 all of them written, 1 some were left out, 2 unusable input.

examples:
  python -m mpgrasp.bench thin --detector oracle --controller mppc --episodes 50 --out out/demos
  python -m mpgrasp.bench export out/demos --format hdf5 --out demos --successes
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench export",
        description="Write episodes of a run as demonstrations: a policy can be trained on them elsewhere.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("run", metavar="RUN", type=Path, help="folder of the run")
    add("--out", metavar="DIR", type=Path, required=True, help="folder to write to; new, or empty")
    add(
        "--format",
        metavar="F",
        choices=FORMATS,
        default=FORMATS[0],
        help=f"{', '.join(FORMATS)} (default: npz)",
    )
    add(
        "--cell",
        metavar="[S/]D/C",
        help="[suite/]detector/controller; may be left out where the run has one cell",
    )
    add("--episodes", metavar="N", type=COUNT, help="the first so many that are wanted (default: all)")
    add("--successes", action="store_true", help="episodes that succeeded, and no others")
    add(
        "--weights",
        metavar="[D=]FILE",
        action="append",
        default=[],
        help="where the weights that the run was given are now, unless they are where they were",
    )
    return parser


def main(command: Sequence[str]) -> int:
    """Play the episodes again, write them and return the exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    arguments: Namespace = make_parser().parse_args(command)
    from mpgrasp.bench.commands.run import make_parser as run_parser
    from mpgrasp.bench.playing.exporting import export
    from mpgrasp.bench.playing.planning import make_plan
    from mpgrasp.bench.playing.recorded_command import recorded_arguments

    given = [word for file in arguments.weights for word in ("--weights", file)]
    plan, _ = make_plan(recorded_arguments(arguments.run, run_parser(), given))
    return export(plan, arguments)
