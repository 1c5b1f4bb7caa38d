"""The benchmark's command line: `python -m mpgrasp.bench SUITE --detector D --controller C ...`."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import traceback
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NoReturn

from mpgrasp.exceptions import ConfigError, MpgraspError

EXIT_BROKEN, EXIT_BAD_INPUT, EXIT_INTERRUPTED = 1, 2, 130

_EPILOG = """\
examples:
  python -m mpgrasp.bench thin
  python -m mpgrasp.bench thin --detector dhrnet,ggcnn,oracle --controller mppc,mvp --episodes 100 --workers 2
  python -m mpgrasp.bench unseen --detector my_net:MyDetector --weights my_net.pt --record 3

Every detector and every controller meets the same scenes, sensor noise and start poses. The same
command gives the same episodes.jsonl again, apart from timing, whatever the number of workers. Each
process computes on one thread (set OMP_NUM_THREADS to change that).

exit code: 0 all episodes played, 1 an episode broke off, 2 unusable input, 130 interrupted (Ctrl-C);
finished episodes are kept in every case.
"""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ConfigError(message, allowed=f"see {self.prog} --help")


def make_parser() -> argparse.ArgumentParser:
    """The command line's options; needs neither torch nor OpenGL nor MuJoCo."""
    from mpgrasp.bench.plugins import controller_names, detector_names
    from mpgrasp.bench.runner import CAMERA_BACKENDS
    from mpgrasp.bench.suite import suite_names

    parser = _Parser(
        prog="python -m mpgrasp.bench",
        description="Closed-loop grasping in simulation: play a suite, print the table, write the results.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("suite", metavar="SUITE", help=f"{', '.join(suite_names())}, or a path to a declaration.toml")
    add(
        "--detector",
        metavar="D[,D]",
        default="dhrnet",
        help=f"{', '.join(detector_names())}, or your own as module:Class (default: dhrnet)",
    )
    add(
        "--controller",
        metavar="C[,C]",
        default="mppc",
        help=f"{', '.join(controller_names())}, or your own as module:Class (default: mppc)",
    )
    add("--episodes", metavar="N", type=int, default=10, help="episodes of each combination (default: 10)")
    add("--seed", metavar="S", type=int, default=0, help="0, 1, 2, ... (default: 0)")
    add("--out", metavar="DIR", type=Path, help="folder of the results (default: runs/SUITE-time)")
    add(
        "--record",
        metavar="N",
        type=int,
        default=0,
        help="record the first N episodes of each combination, for rerun and as GIF (default: 0)",
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
        "--camera",
        metavar="|".join(CAMERA_BACKENDS),
        default="auto",
        help="rasterised through OpenGL, ray-cast without it, or whichever is there (default: auto)",
    )
    add("--no-noise", action="store_true", help="a perfect depth camera")
    add("--workers", metavar="K", type=int, default=1, help="play in K processes (default: 1)")
    add("--quiet", action="store_true", help="no progress, only the table")
    return parser


def run(arguments: argparse.Namespace, command: Sequence[str]) -> int:
    """Play what the command line asks for.

    Returns:
        The exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    from mpgrasp.bench.plugins import check_name, controller_names, detector_names, parse_weights
    from mpgrasp.bench.report import ProgressReport, print_table
    from mpgrasp.bench.run_directory import RunDirectory
    from mpgrasp.bench.runner import EpisodeError, Plan, Player, play_all
    from mpgrasp.bench.statistics import summarise
    from mpgrasp.bench.suite import load_suite

    detectors, controllers = (tuple(names.split(",")) for names in (arguments.detector, arguments.controller))
    for name in detectors:
        check_name("detector", name, detector_names())
    for name in controllers:
        check_name("controller", name, controller_names())
    if arguments.workers < 1:
        raise ConfigError("workers out of range", got=arguments.workers, allowed="1 or more")
    suite = load_suite(arguments.suite)
    out = arguments.out or Path("runs") / f"{suite.name}-{datetime.now():%Y%m%d-%H%M%S}"
    plan = Plan(
        suite=suite,
        detectors=detectors,
        controllers=controllers,
        weights=parse_weights(arguments.weights, detectors),
        episodes=arguments.episodes,
        seed=arguments.seed,
        camera=arguments.camera,
        noise=not arguments.no_noise,
        record=arguments.record,
        recordings=out / "recordings",
    )
    player = Player(plan)  # whatever is wrong with a detector or controller shows before the first episode
    directory = RunDirectory.create(out, describe(plan, player, command))
    code = 0
    try:
        with ProgressReport(len(plan.tasks()), quiet=arguments.quiet) as progress:

            def finished(line: dict[str, Any]) -> None:
                directory.append(line)
                progress.add(line)

            play_all(plan, finished, workers=arguments.workers, player=player)
    except KeyboardInterrupt:
        print("mpgrasp: interrupted; the finished episodes are kept", file=sys.stderr)
        code = EXIT_INTERRUPTED
    except EpisodeError as error:
        details = directory.write_text("traceback.txt", traceback.format_exc())
        print(f"mpgrasp: error: {error}; see {details}", file=sys.stderr)
        code = EXIT_BROKEN
    finally:
        cells = summarise(directory.episodes())
        directory.write_summary(cells, complete=sum(cell["n"] for cell in cells) == len(plan.tasks()))
        directory.close()
        print_table(cells)
        print(f"Results: {out}")
    return code


def describe(plan: Any, player: Any, command: Sequence[str]) -> dict[str, Any]:
    """Content of run.json: all that decides the results, and what they were made with.

    `configuration` is what two runs in one folder must agree in.
    """
    from mpgrasp.bench.provenance import provenance, sha256
    from mpgrasp.bench.world_card import world_card
    from mpgrasp.detectors.detector import reads_truth
    from mpgrasp.paths import WEIGHTS

    return {
        "format": 1,
        "command": shlex.join(["python", "-m", "mpgrasp.bench", *command]),
        "started": datetime.now().astimezone().isoformat(timespec="seconds"),
        "configuration": {
            "suite": plan.suite,
            "episode": player.episode_config,
            "detectors": [
                {
                    "name": name,
                    "weights": str(given) if (given := plan.weights.get(name)) else None,
                    # of the shipped weights where none are given; a plug-in's own are its own affair
                    "sha256": sha256(given or WEIGHTS / f"{name}.safetensors"),
                    "reads_truth": reads_truth(detector),
                    "device": getattr(detector, "device", None),
                    "config": getattr(detector, "config", None),
                }
                for name, detector in player.detectors.items()
            ],
            "controllers": [
                {"name": name, "config": getattr(controller, "config", None)}
                for name, controller in player.controllers.items()
            ],
            "episodes": plan.episodes,
            "seed": plan.seed,
            "camera": plan.camera,
            "noise": plan.noise,
        },
        **world_card(plan.suite, player.episode_config, plan.seed),
        "made_with": provenance(),
    }


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    # before numpy and torch are loaded: results must not depend on how many cores there are
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    command = sys.argv[1:] if command is None else command
    try:
        return run(make_parser().parse_args(command), command)
    except MpgraspError as error:
        print("mpgrasp: error:", " ".join(str(error).splitlines()), file=sys.stderr)
        return EXIT_BAD_INPUT
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
