"""`python -m mpgrasp.bench race A B --suite SUITE`: which of two methods is better, as soon as known."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from itertools import takewhile

from mpgrasp.bench.commands.run import make_parser as run_parser
from mpgrasp.bench.commands.run import parse
from mpgrasp.bench.playing.recorded_command import RACE
from mpgrasp.command_line import Parser, number
from mpgrasp.exceptions import ConfigError
from mpgrasp.plugin_names import method_of

_EPILOG = """\
examples:
  python -m mpgrasp.bench race dhrnet/mppc_robust ggcnn/mppc_robust --suite thin_2mm
  python -m mpgrasp.bench race my_net:MyDetector/mppc dhrnet/mppc --suite unseen --alpha 0.01 --workers 4

A and B are DETECTOR/CONTROLLER. Both play the same worlds, and after every 5 a test is made that may be
looked at at any time: two equal methods are called different with a probability of at most --alpha, however
often one looks. The race ends when it is known which is better, or at --max-episodes (default: 1000).

All options of a run may follow (see `python -m mpgrasp.bench --help`), apart from --detector, --controller,
--episodes and --until-ci.
"""


class RaceParser:
    """Command line of a race: two methods, a suite and alpha, and besides the options of a run."""

    prog = "python -m mpgrasp.bench race"
    race = True
    """Runs that it reads are races."""

    def __init__(self) -> None:
        self._own = Parser(
            prog=self.prog,
            description="Have two methods play the same worlds until it is known which is better.",
            epilog=_EPILOG,
            allow_abbrev=False,
            usage="%(prog)s A B --suite SUITE [--alpha P] [options ...]",
        )
        add = self._own.add_argument
        add("--suite", metavar="SUITE", help="as for a run")
        add(
            "--alpha",
            metavar="P",
            type=number(1e-6, 0.5),
            default=0.05,
            help="probability, at most, of calling two equal methods different (default: 0.05)",
        )

    def parse_args(self, words: Sequence[str]) -> argparse.Namespace:
        """Arguments of a run, with those of the race.

        Raises:
            ConfigError: unusable words.
        """
        methods = [*takewhile(lambda word: not word.startswith("-"), words)]
        own, rest = self._own.parse_known_args(words[len(methods) :])
        arguments = run_parser().parse_args([*([] if own.suite is None else [own.suite]), *rest])
        arguments.race, arguments.alpha = tuple(methods), own.alpha
        if methods or own.suite is not None:
            self._check(methods, own.suite, arguments)
        return arguments

    def _check(self, methods: Sequence[str], suite: str | None, arguments: argparse.Namespace) -> None:
        if len(methods) != 2:
            allowed = "DETECTOR/CONTROLLER DETECTOR/CONTROLLER"
            raise ConfigError("a race is of two methods", got=" ".join(methods), allowed=allowed)
        for name in methods:
            method_of(name)
        if methods[0] == methods[1]:
            raise ConfigError("a race of a method with itself", got=methods[0], allowed="two methods")
        if suite is None:
            allowed = f"see {self.prog} --help"
            raise ConfigError("the following arguments are required: --suite", allowed=allowed)
        for option in ("detector", "controller", "episodes", "until_ci", "shard"):
            if getattr(arguments, option) is not None:
                given = str(getattr(arguments, option))
                raise ConfigError(f"a race with --{option.replace('_', '-')}", got=given, allowed="without")


def make_parser() -> argparse.ArgumentParser:
    """The options of a race by themselves."""
    return RaceParser()._own


def main(command: Sequence[str]) -> int:
    """Run the race and return the exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    arguments = parse(command, RaceParser())
    if not arguments.race:
        raise ConfigError("a race is of two methods", got="none", allowed="race A B --suite SUITE")
    from mpgrasp.bench.playing.run import run

    return run(arguments, [RACE, *command])
