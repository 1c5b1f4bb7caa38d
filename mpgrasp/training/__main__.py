"""`python -m mpgrasp.training generate|train`: training data, and networks trained on them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NoReturn

from mpgrasp.exceptions import MpgraspError


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand; returns the exit code, 2 for input that cannot be used."""
    from mpgrasp.training import generate, train

    parser = _Parser(prog="python -m mpgrasp.training", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="generate|train")
    helps = (("generate", generate, "make a data set"), ("train", train, "train a network on one"))
    for name, module, text in helps:
        command = commands.add_parser(name, description=module.__doc__, help=text)
        module.add_arguments(command)
        command.set_defaults(run=module.main)
    args = parser.parse_args(argv)
    try:
        return int(args.run(args) or 0)
    except MpgraspError as error:
        print(f"mpgrasp.training: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"mpgrasp.training: {message}; see {self.prog} --help\n")


if __name__ == "__main__":
    sys.exit(main())
