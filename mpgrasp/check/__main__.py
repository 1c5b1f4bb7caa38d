"""`python -m mpgrasp.check detector|controller NAME`: whether a plug-in may be believed."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from mpgrasp.command_line import Parser, run_command
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.exceptions import ConfigError

EXIT_BROKEN = 1
_EPILOG = """\
examples:
  python -m mpgrasp.check detector my_net:MyDetector
  python -m mpgrasp.check detector my_net:MyDetector --weights my_net.pt --set detector.threshold=0.3
  python -m mpgrasp.check controller my_ctrl:MyController --json
  python -m mpgrasp.check detector dhrnet

A law must hold: results of a plug-in that breaks one mean nothing. An advice should be followed. A check that
takes longer than 120 s counts as broken (MPGRASP_LOAD_LIMIT changes that).

exit code: 0 every law holds, 1 a law is broken, 2 unusable input, 130 interrupted (Ctrl-C).
"""


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    # before torch is loaded: times are those of one thread, as in the benchmark, unless asked otherwise
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run_command(lambda: _run(make_parser().parse_args(command)))


def _run(options: argparse.Namespace) -> int:
    from mpgrasp.check.trial import try_controller, try_detector
    from mpgrasp.settings.assignment import parse_assignments

    tables = parse_assignments(options.set)
    others = [group for group in tables if group != options.kind]
    if others:
        raise ConfigError(f"--set of another group than {options.kind}", got=others[0], allowed=options.kind)
    settings = tables.get(options.kind, {})
    if options.kind == "detector":
        verdict = try_detector(options.name, settings, options.weights, options.runtime)
    else:
        verdict = try_controller(options.name, settings)
    if options.json:
        print(verdict.as_json())
    else:
        verdict.print()
    return 0 if verdict.fit else EXIT_BROKEN


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line; needs neither torch nor OpenGL nor MuJoCo."""
    parser = Parser(
        prog="python -m mpgrasp.check",
        description="Try a detector or a controller on scenes of which the answer is known: units, "
        "directions, memory, speed. It takes seconds, and no physics.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="detector|controller")
    for kind in ("detector", "controller"):
        add = kinds.add_parser(kind, help=f"try a {kind}", allow_abbrev=False).add_argument
        add("name", metavar="NAME", help="in the registry, or your own as module:Class")
        add(
            "--set",
            metavar=f"{kind}.KEY=VALUE",
            action="append",
            default=[],
            help="change a setting, as for a run of the benchmark; may be given several times",
        )
        add("--json", action="store_true", help="print JSON in place of the table")
        if kind == "detector":
            add("--weights", metavar="FILE", type=Path, help="in place of the shipped ones")
            add(
                "--runtime",
                metavar="|".join(RUNTIMES),
                default="auto",
                help="what computes networks (default: auto)",
            )
    return parser


if __name__ == "__main__":
    sys.exit(main())
