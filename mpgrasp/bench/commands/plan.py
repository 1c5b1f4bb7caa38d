"""`python -m mpgrasp.bench plan SUITE ...`: how long a run takes, here and on more workers."""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mpgrasp.bench.commands.run import make_parser as run_parser
from mpgrasp.command_line import number, whole
from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from rich.table import Table

    from mpgrasp.bench.profiling.forecast import Forecast

MOST_WORKERS = 100_000
_EPILOG = """\
examples:
  python -m mpgrasp.bench plan thin --episodes 1000 --detector dhrnet,ggcnn --workers 2
  python -m mpgrasp.bench plan paper --on 16,64
  python -m mpgrasp.bench plan sweep thin --set controller.gamma=0,4/3,8

Takes the options of a run, or after `sweep` those of a sweep, and plays a sample of its episodes with its
workers until the time is known to 8 %, or --seconds are over. Nothing is written. --on says on how many
workers like these else: as fast each, with a core of its own.
"""


def make_parser() -> argparse.ArgumentParser:
    """The command line's options: those of a run, and two more."""
    parser = run_parser()
    parser.prog = "python -m mpgrasp.bench plan"
    parser.description = "Say how long a run takes, from playing some of its episodes."
    parser.epilog = _EPILOG
    parser.add_argument(
        "--on",
        metavar="K[,K]",
        type=_numbers,
        default=(8, 64),
        help="numbers of workers that the time is given for, besides --workers (default: 8,64)",
    )
    parser.add_argument(
        "--seconds",
        metavar="S",
        type=number(0, 24 * 3600, "s"),
        default=120.0,
        help="time after which no more episodes are begun, in seconds (default: 120)",
    )
    return parser


def main(command: Sequence[str]) -> int:
    """Play the sample, print the forecast and return the exit code.

    Raises:
        MpgraspError: input that cannot be used, or an episode that cannot be played.
    """
    sweep = bool(command) and command[0] == "sweep"
    arguments = make_parser().parse_args(command[1:] if sweep else command)
    arguments.sweep = sweep
    for option in ("out", "resume"):
        if getattr(arguments, option) is not None:
            raise ConfigError(f"plan with --{option}", got=str(getattr(arguments, option)), allowed="a run")
    if arguments.suite is None:
        raise ConfigError("the following arguments are required: SUITE", allowed="see --help")
    from rich.console import Console

    from mpgrasp.bench.playing.crew import check_engine, make_crew, shared_networks
    from mpgrasp.bench.playing.planning import make_plan
    from mpgrasp.bench.playing.player import Player
    from mpgrasp.bench.profiling.forecast import forecast

    check_engine(arguments.engine, arguments.workers, arguments.address)
    plan, _ = make_plan(arguments)
    console = Console()
    with shared_networks(plan.runtime, arguments.engine), tempfile.TemporaryDirectory() as folder:
        plan = dataclasses.replace(plan, traces=Path(folder), record=0)
        Player(plan).prepare()
        crew = make_crew(
            plan,
            arguments.workers,
            hang_after=arguments.hang_after,
            engine=arguments.engine,
            address=arguments.address,
        )
        try:
            found = forecast(plan, crew, arguments.workers, limit=arguments.seconds)
        finally:
            crew.close()
    if plan.until_ci is not None:
        console.print("of the first batch of each suite; --until-ci adds more", highlight=False)
    console.print(shares(found))
    precision = 100 * found.half_width / found.whole
    console.print(f"The run takes, to {precision:.0f} %:", highlight=False)
    console.print(times(found, max(arguments.workers, 1), arguments.on))
    return 0


def shares(found: Forecast) -> Table:
    """Return the table of the suites."""
    from rich.table import Table

    table = Table("suite")
    for heading in ("episodes", "played now", "s each", "hours in one worker"):
        table.add_column(heading, justify="right")
    for name, share in found.shares.items():
        played = len(share.seconds)
        each = f"{share.whole / share.episodes:.1f}"
        table.add_row(name, f"{share.episodes:,}", f"{played}", each, f"{share.whole / 3600:.3g}")
    return table


def times(found: Forecast, workers: int, others: Sequence[int]) -> Table:
    """Return the table of the run's time by number of workers."""
    from rich.table import Table

    table = Table()
    for heading in ("workers", "time"):
        table.add_column(heading, justify="right")
    table.add_row(f"{workers}, here", duration(found.time(workers)))
    for number_of in others:
        table.add_row(f"{number_of:,}", duration(found.time(number_of)))
    return table


def duration(seconds: float) -> str:
    """Return a time in a unit that gives it a number one can imagine."""
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.0f} s"


def _numbers(text: str) -> tuple[int, ...]:
    """The numbers of workers that a text names."""
    return tuple(map(whole(1, MOST_WORKERS), text.split(",")))
