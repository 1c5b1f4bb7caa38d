"""`python -m mpgrasp.bench profile [SUITE]`: where the CPU time of an episode goes."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mpgrasp.bench.commands.run import add_settings
from mpgrasp.command_line import SEED, Parser, whole

if TYPE_CHECKING:
    from rich.table import Table

    from mpgrasp.bench.profiling.cost import Cost

MOST = 1000
"""Most episodes of each combination."""
_EPILOG = """\
examples:
  python -m mpgrasp.bench profile thin
  python -m mpgrasp.bench profile stacked --detector ggcnn,my_net:MyDetector --episodes 1

CPU milliseconds of one episode, the mean over --episodes of them, in one process; one more is played before
and not counted. No stage counts what another one within it takes. "network" is what the runtime computes
alone; "its image, its maps" is all else of predict(): crop, holes, smoothing. Of a detector that is no
network of mpgrasp, all of predict() is there.
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench profile",
        description="Print where the CPU time of an episode goes, stage by stage.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("suite", metavar="SUITE", nargs="?", default="thin", help="as for a run (default: thin)")
    add("--suites", metavar="S[,S]", help="as for a run")
    add("--detector", metavar="D[,D]", help="as for a run")
    add("--controller", metavar="C[,C]", help="as for a run")
    add(
        "--episodes",
        metavar="N",
        type=whole(1, MOST),
        default=5,
        help="of each combination (default: 5)",
    )
    add("--weights", metavar="[D=]FILE", action="append", default=[], help="as for a run")
    add("--runtime", metavar="R", default="auto", help="as for a run")
    add("--camera", metavar="C", default="auto", help="as for a run")
    add("--no-noise", action="store_true", help="a perfect depth camera")
    add("--seed", metavar="S", type=SEED, default=0, help="as for a run")
    add_settings(parser)
    return parser


def main(command: Sequence[str]) -> int:
    """Play some episodes, print a table for each cell and return the exit code.

    Raises:
        MpgraspError: input that cannot be used, or an episode that broke off.
    """
    given = vars(make_parser().parse_args(command))
    from rich.console import Console

    from mpgrasp.bench.commands.run import make_parser as run_parser
    from mpgrasp.bench.playing.crew import shared_networks
    from mpgrasp.bench.playing.planning import make_plan
    from mpgrasp.bench.playing.player import Player
    from mpgrasp.bench.profiling.cost import measure

    arguments = run_parser().parse_args([given["suite"]])
    vars(arguments).update(given)
    plan, _ = make_plan(arguments)
    console = Console()
    with shared_networks(plan.runtime, "processes"), tempfile.TemporaryDirectory() as folder:
        player = Player(dataclasses.replace(plan, traces=Path(folder)))
        for line in player.prepare():
            console.print(line, highlight=False)
        console.print(f"ready to play after {time.process_time():.1f} s of CPU time", highlight=False)
        for cost in measure(player):
            console.print(f"\n{heading(cost)}", highlight=False, markup=False)
            console.print(table(cost))
    return 0


def heading(cost: Cost) -> str:
    """Return two sentences about a cell's cost."""
    from mpgrasp.bench.profiling.stages import REACH

    cell, each = cost.cell, cost.of(part=REACH) / max(cost.ticks, 1)
    return (
        f"{cell.suite}, {cell.detector}, {cell.controller}: {cost.of() / 1e3:.2f} s of CPU time an episode\n"
        f"(mean of {cost.episodes}; {cost.ticks:.0f} ticks of the reach with {each:.1f} ms each)"
    )


def table(cost: Cost) -> Table:
    """Return the table of a cell's cost."""
    from rich.table import Table

    from mpgrasp.bench.profiling.stages import PARTS

    whole, result = cost.of(), Table(show_footer=True)
    result.add_column("stage, ms", "all", no_wrap=True)
    for part in PARTS:
        result.add_column(part, f"{cost.of(part=part):.0f}", justify="right")
    result.add_column("all", f"{whole:.0f}", justify="right")
    result.add_column("share", "100 %", justify="right")
    for stage in cost.milliseconds:
        row = [cost.of(part=part, stage=stage) for part in PARTS]
        share = f"{100 * sum(row) / whole:.0f} %"
        result.add_row(stage, *(f"{time:.0f}" for time in (*row, sum(row))), share)
    return result
