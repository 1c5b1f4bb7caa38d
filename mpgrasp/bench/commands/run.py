"""`python -m mpgrasp.bench SUITE ...`: options of the command that plays a suite."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mpgrasp.command_line import (
    COUNT,
    MOST_EPISODES,
    MOST_UNTIL_CI,
    SEED,
    WORKERS,
    Parser,
    number,
    whole,
)
from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from mpgrasp.bench.playing.recorded_command import CommandParser

_EPILOG = """\
examples:
  python -m mpgrasp.bench thin
  python -m mpgrasp.bench thin --detector dhrnet,ggcnn,oracle --controller mppc,mvp --episodes 100 --workers 2
  python -m mpgrasp.bench unseen --detector my_net:MyDetector --weights my_net.pt --record 3
  python -m mpgrasp.bench thin --episodes 50 --until-ci 10
  python -m mpgrasp.bench paper --workers 2
  python -m mpgrasp.bench paper --suites unseen,thin --episodes 100 --baseline published
  python -m mpgrasp.bench thin --set controller.gamma=4/3 --set sensor.subpixel=0.12
  python -m mpgrasp.bench sweep thin --set controller.gamma=0,4/3,8 --set controller.alpha=0.2,1
  python -m mpgrasp.bench --resume runs/thin-20260101-120000
  python -m mpgrasp.bench thin --episodes 1000 --shard 3/16 --out shards/3
  python -m mpgrasp.bench merge shards/* --out thin-1000
  python -m mpgrasp.bench ladder thickness --detector dhrnet,ggcnn
  python -m mpgrasp.bench race dhrnet/mppc ggcnn/mppc --suite thin
  python -m mpgrasp.bench plan thin --episodes 1000
  python -m mpgrasp.bench profile thin
  python -m mpgrasp.bench compare RUN_A RUN_B
  python -m mpgrasp.bench replay RUN --episode 3
  python -m mpgrasp.bench report RUN
  python -m mpgrasp.bench export RUN --out demos
  python -m mpgrasp.bench leaderboard RUN RUN
  python -m mpgrasp.bench settings thin

Words such as merge, ladder, race or sweep have a help of their own: python -m mpgrasp.bench merge --help

Every detector and every controller meets the same scenes, sensor noise and start poses. The same
command gives the same episodes.jsonl again, apart from timing, whatever the number of workers. Each
process computes on one thread (set OMP_NUM_THREADS to change that).

An episode whose process crashes, hangs or raises an error is played once more, and is then an error row,
with its traceback in errors/: counted apart from failures. A run that was killed loses the episodes in
hand; --resume plays those and the rest, and tries error rows again.

exit code: 0 all episodes played, 1 some could not be played, 2 unusable input or output, 130 interrupted
(Ctrl-C); finished episodes are kept in every case.
"""

LONGEST = 7 * 24 * 3600.0
"""Longest wall-clock time of an episode that can be waited for [s]: a week."""


def make_parser() -> argparse.ArgumentParser:
    """The command line's options; needs neither torch nor OpenGL nor MuJoCo."""
    from mpgrasp.bench.analysis.paper import Baseline
    from mpgrasp.bench.playing.crew import ENGINES
    from mpgrasp.bench.playing.programme import PROGRAMMES
    from mpgrasp.bench.playing.workers import HANG_AFTER
    from mpgrasp.camera.backends import BACKENDS
    from mpgrasp.detectors.runtimes import RUNTIMES
    from mpgrasp.plugins import controller_names, detector_names
    from mpgrasp.suite import suite_names

    parser = Parser(
        prog="python -m mpgrasp.bench",
        description="Closed-loop grasping in simulation: play a suite, print the table, write the results.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add(
        "suite",
        metavar="SUITE",
        nargs="?",
        help=f"{', '.join(suite_names())}, {', '.join(PROGRAMMES)} (all of Tables III to VI), or a path to a "
        "declaration.toml; may be left out with --resume",
    )
    add("--suites", metavar="S[,S]", help="paper: play these of its suites alone (default: all)")
    add(
        "--detector",
        metavar="D[,D]",
        help=f"{', '.join(detector_names())}, or your own as module:Class (default: dhrnet; "
        "paper: ggcnn, tfgrasp and dhrnet, with references)",
    )
    add(
        "--controller",
        metavar="C[,C]",
        help=f"{', '.join(controller_names())}, your own as module:Class, or a policy as sb3:FILE.zip "
        "(default: mppc; paper: mvp, mppc, mvp_robust and mppc_robust)",
    )
    add(
        "--baseline",
        choices=[baseline.value for baseline in Baseline],
        help="paper: play the controllers of one baseline alone, published (mvp and mppc) or robust "
        "(mvp_robust and mppc_robust); (default: both, which takes nearly twice as long)",
    )
    add(
        "--episodes",
        metavar="N",
        type=COUNT,
        help="episodes of each combination (default: what the suite declares, the paper's number)",
    )
    add(
        "--until-ci",
        metavar="W",
        type=number(0, 100, "percentage points", above=True),
        help="go on in batches of N episodes until every 95 %% interval is narrower than W points; these "
        "intervals hold at all times at once, and are wider than those of the table",
    )
    add(
        "--max-episodes",
        metavar="M",
        type=COUNT,
        help=f"where --until-ci ends in any case (default: {MOST_UNTIL_CI})",
    )
    add(
        "--objects",
        metavar="MESH",
        nargs="+",
        action="extend",
        default=[],
        help="single and unseen: meshes in metres in the place of the suite's objects, one per episode in "
        "turn: GLB, OBJ, PLY, STL and URDF files, folders of them or of folders with one object each, or "
        "ycb for those scans of the YCB set that the hand can close on however they lie (pip install "
        "mpgrasp[ycb])",
    )
    add(
        "--density",
        metavar="D",
        type=number(1, 25000, "kg/m^3"),
        help="of these objects, which decides their mass, in kg/m^3 (default: 500)",
    )
    add(
        "--scale",
        metavar="M",
        type=number(1e-6, 1e3, "m"),
        help="unit of the numbers in these files: 0.001 for millimetres (default: 1, metres)",
    )
    add_settings(parser)
    add(
        "--shard",
        metavar="K/N",
        help="play every N-th episode alone, from the K-th on (1 to N), for runs on several machines; "
        "`merge` puts the shards together",
    )
    add("--seed", metavar="S", type=SEED, default=0, help="0, 1, 2, ... (default: 0)")
    add("--out", metavar="DIR", type=Path, help="folder of the results (default: runs/SUITE-time)")
    add(
        "--resume",
        metavar="DIR",
        type=Path,
        help="finish the run in DIR, by the command it was begun with; refused if anything has changed that "
        "decides its results",
    )
    add(
        "--record",
        metavar="N",
        type=whole(0, MOST_EPISODES),
        default=0,
        help="record the first N episodes of each combination, for rerun, as GIF and as MP4 (default: 0)",
    )
    add(
        "--weights",
        metavar="[D=]FILE",
        action="append",
        default=[],
        help="weights in place of those that ship with mpgrasp; D= says whose, and may be left out with "
        "one detector; may be given several times",
    )
    add(
        "--runtime",
        metavar="|".join(RUNTIMES),
        default="auto",
        help="what computes the networks (default: auto, the fastest one here; shared: one process for all "
        "workers, which serves them best from one GPU)",
    )
    add(
        "--camera",
        metavar="|".join(BACKENDS),
        default="auto",
        help="rasterised through OpenGL, ray-cast without it, or whichever is there (default: auto)",
    )
    add("--no-noise", action="store_true", help="a perfect depth camera")
    add(
        "--workers",
        metavar="K",
        type=WORKERS,
        default=len(os.sched_getaffinity(0)),
        help="play in K processes (default: one per core); 0 plays in this one, for debuggers",
    )
    add(
        "--engine",
        metavar="|".join(ENGINES),
        choices=ENGINES,
        default=ENGINES[0],
        help="what --workers are: processes of this machine, or actors of Ray, on this machine or with "
        "--address on a cluster (pip install mpgrasp[ray]); results are the same (default: processes)",
    )
    add("--address", metavar="A", help="of a Ray cluster that runs, such as auto")
    add(
        "--hang-after",
        metavar="S",
        type=number(0, LONGEST, "s", above=True),
        help="seconds after which an episode's process is taken for hung (default: "
        f"{HANG_AFTER['grasp']:g} for one grasp, {HANG_AFTER['clear']:g} for a table to be cleared)",
    )
    add("--quiet", action="store_true", help="no progress, only the table")
    add(
        "--no-report",
        action="store_true",
        help="no report and none of its pictures, which saves two seconds; `report DIR` makes one later",
    )
    parser.set_defaults(sweep=False, ladder=False, race=())
    return parser


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options that change settings."""
    parser.add_argument(
        "--set",
        metavar="GROUP.KEY=VALUE",
        action="append",
        default=[],
        help="change a setting of the suite, of the world or of what plays, such as controller.gamma=4/3 or "
        "sensor.subpixel=0.12; may be given several times; `settings` in the place of SUITE prints them all",
    )
    parser.add_argument(
        "--preset",
        metavar="NAME",
        help="defaults of mvp and mppc, which --set may change: table1, published-grid or robust",
    )


def parse(command: Sequence[str], parser: CommandParser | None = None) -> argparse.Namespace:
    """Arguments of a run, those of a resumed one taken from its run.json.

    Args:
        command: words after the program, and after `sweep` where that is one.
        parser: of these words; that of a run unless given.

    Raises:
        ConfigError: unusable arguments, or a file of the resumed run that is not there any more.
        OutputError: nothing to resume.
    """
    parser = parser or make_parser()
    arguments = parser.parse_args(command)
    if arguments.resume is None:
        if arguments.suite is None:
            raise ConfigError(
                "the following arguments are required: SUITE", allowed=f"see {parser.prog} --help"
            )
        return arguments
    if arguments.out is not None:
        raise ConfigError("--out beside --resume", got=str(arguments.out), allowed="one of both")
    if arguments.suite is None:
        from mpgrasp.bench.playing.recorded_command import recorded_arguments

        arguments = recorded_arguments(arguments.resume, parser, command)
    arguments.out = arguments.resume
    return arguments
