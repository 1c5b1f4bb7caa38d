"""`python -m mpgrasp.training generate|train|calibrate`: training data, networks, and what these claim."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from mpgrasp.command_line import Parser, run_command


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code, 2 for input that cannot be used."""
    return run_command(lambda: _run(argv))


def _run(argv: Sequence[str] | None) -> int:
    from mpgrasp.training import calibrate, generate, train

    parser = Parser(prog="python -m mpgrasp.training", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="generate|train|calibrate")
    helps = (
        ("generate", generate, "make a data set"),
        ("train", train, "train a network on one"),
        ("calibrate", calibrate, "make its claims probabilities"),
    )
    for name, module, text in helps:
        command = commands.add_parser(name, description=module.__doc__, help=text)
        module.add_arguments(command)
        command.set_defaults(run=module.main)
    args = parser.parse_args(argv)
    return int(args.run(args))


if __name__ == "__main__":
    sys.exit(main())
