"""`python -m mpgrasp.detectors show|check|card|graph`: what detectors see, and what is known of them.

The subcommands are modules of `mpgrasp.inspection`: this package knows nothing of the world.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from mpgrasp.command_line import COUNT, EPISODE, SEED, Parser, number, run_command
from mpgrasp.detectors.runtimes import RUNTIMES

_RUNTIMES = "|".join(RUNTIMES)
_EPILOG = """\
examples:
  python -m mpgrasp.detectors show dhrnet --suite thin --seed 3 --height 0.5 --out thin.png
  python -m mpgrasp.detectors show ggcnn2,dhrnet,oracle --suite unseen --above-object --height 0.2
  python -m mpgrasp.detectors show ggcnn2 --set detector.quality_sigma=0 --set sensor.subpixel=0.2
  python -m mpgrasp.detectors show my_net:MyDetector --weights my_net.pt
  python -m mpgrasp.detectors check dhrnet --runtime openvino --frames 100
  python -m mpgrasp.detectors card dhrnet --weights out/dhrnet.safetensors
  python -m mpgrasp.detectors graph dhrnet --weights out/dhrnet.safetensors

exit code: 0 done, 1 the runtime finds other grasps (check), 2 unusable input, 130 interrupted (Ctrl-C).
"""


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    # before torch is loaded: times are those of one thread, as in the benchmark, unless asked otherwise
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run_command(lambda: _run(make_parser().parse_args(command)))


def _run(options: argparse.Namespace) -> int:
    if options.command == "show":
        from mpgrasp.inspection.show import run
    elif options.command == "check":
        from mpgrasp.inspection.check import run
    elif options.command == "graph":
        from mpgrasp.inspection.graph import run
    else:
        from mpgrasp.inspection.card import run
    return run(options)


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line; needs neither torch nor OpenGL nor MuJoCo."""
    parser = Parser(
        prog="python -m mpgrasp.detectors",
        description="See what grasp detectors see, how exact they are, and what is known of their weights.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="show|check|card|graph")
    show = commands.add_parser(
        "show", help="draw their maps and best grasps side by side", allow_abbrev=False
    )
    add = show.add_argument
    add("detector", metavar="D[,D]", help="names, or your own as module:Class")
    add("--suite", default="thin", help="suite, or a path to a declaration.toml (default: thin)")
    add("--seed", metavar="S", type=SEED, default=0, help="of the benchmark run (default: 0)")
    add("--episode", metavar="K", type=EPISODE, default=0, help="of that run, from 0 (default: 0)")
    add(
        "--height",
        metavar="Z",
        type=number(0.1, 1.0, "m"),
        default=0.5,
        help="of the tool [m] (default: 0.5)",
    )
    add(
        "--above-object",
        metavar="OBJECT",
        nargs="?",
        const="",
        help="camera over an object, the scene's first if not said, in place of the episode's start",
    )
    add("--out", metavar="FILE.png", type=Path, default=Path("show.png"), help="(default: show.png)")
    add("--weights", metavar="[D=]FILE", action="append", default=[], help="in place of the shipped ones")
    add("--camera", metavar="auto|gl|ray", default="auto", help="depth camera's backend (default: auto)")
    add("--no-noise", action="store_true", help="a perfect depth camera")
    add(
        "--set",
        metavar="GROUP.KEY=VALUE",
        action="append",
        default=[],
        help="change a setting of the detectors, the sensor, the camera or the scene, as for a run of the "
        "benchmark; may be given several times",
    )
    add("--runtime", metavar=_RUNTIMES, default="auto", help="what computes networks (default: auto)")
    check = commands.add_parser(
        "check", help="compare a network's grasps in a runtime with those in plain torch", allow_abbrev=False
    )
    add = check.add_argument
    add("detector", metavar="NAME", help="a network's name")
    add("--runtime", metavar=_RUNTIMES, default="auto", help="what computes it (default: auto)")
    add("--suite", default="thin", help="whose scenes are looked at (default: thin)")
    add("--frames", metavar="N", type=COUNT, default=100, help="number of images (default: 100)")
    add("--seed", metavar="S", type=SEED, default=0, help="of the scenes and views (default: 0)")
    add("--weights", metavar="FILE", type=Path, help="in place of the shipped ones")
    add("--camera", metavar="auto|gl|ray", default="auto", help="depth camera's backend (default: auto)")
    about = commands.add_parser("card", help="print the training card of weights", allow_abbrev=False)
    about.add_argument("detector", metavar="NAME", help="whose weights they are")
    about.add_argument("--weights", metavar="FILE", type=Path, help="in place of the shipped ones")
    graph = commands.add_parser(
        "graph", help="write a network without its weights, to use these without torch", allow_abbrev=False
    )
    add = graph.add_argument
    add("detector", metavar="NAME", help="a network's name")
    add("--weights", metavar="FILE", type=Path, help="whose settings it is for, in place of the shipped ones")
    add("--out", metavar="FILE.graph", type=Path, help="(default: beside the weights)")
    return parser


if __name__ == "__main__":
    sys.exit(main())
