"""`python -m mpgrasp.view SUITE --episode K`: an episode of the benchmark, watched while it is played."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.command_line import EPISODE, SEED, Parser, run_command
from mpgrasp.exceptions import ConfigError

_EPILOG = """\
examples:
  python -m mpgrasp.view thin --seed 3 --detector dhrnet --controller mppc
  python -m mpgrasp.view find_stick --episode 5 --out pictures
  python -m mpgrasp.view thin --live

Without --out and --live it opens MuJoCo's viewer, with depth, quality and utility in the corner; where there
is no display it writes pictures. The episode is that of the benchmark, bit for bit.

exit code: 0, 2 unusable input, 130 interrupted (Ctrl-C, or the window was closed).
"""


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run_command(lambda: _run(make_parser().parse_args(command)))


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = Parser(
        prog="python -m mpgrasp.view",
        description="Watch an episode of the benchmark while it is played.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("suite", metavar="SUITE", help="a suite, or a path to a declaration that ends in .toml")
    add("--seed", metavar="S", type=SEED, default=0, help="of the benchmark's run (default: 0)")
    add("--episode", metavar="K", type=EPISODE, default=0, help="its number in that run (default: 0)")
    add("--detector", metavar="D", default="dhrnet", help="as for the benchmark (default: dhrnet)")
    add("--controller", metavar="C", default="mppc", help="likewise (default: mppc)")
    add(
        "--set",
        metavar="GROUP.KEY=VALUE",
        action="append",
        default=[],
        help="change a setting, as for a run of the benchmark; may be given several times",
    )
    add("--camera", choices=BACKENDS, default="auto", help="backend of the cameras (default: auto)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--out", metavar="DIR", type=Path, help="write pictures into this folder")
    where.add_argument(
        "--live",
        metavar="ADDRESS",
        nargs="?",
        const="",
        help="stream to the rerun viewer at an address; without one, to a viewer that is started",
    )
    add("--every", metavar="T", type=float, help="from a picture to the next [s] (default: 1)")
    add("--speed", metavar="X", type=float, default=1.0, help="pace of the window's time (default: 1)")
    return parser


def _run(options: argparse.Namespace) -> int:
    from mpgrasp.recording.recorder import Recorder
    from mpgrasp.recording.window import Window, has_display
    from mpgrasp.view.pictures import Pictures
    from mpgrasp.view.play import play

    out, why, pictures = options.out, "", None
    recorder: Recorder
    if options.live is not None:
        from mpgrasp.recording.live_rerun import LiveRerun

        recorder = LiveRerun(options.live or None)
    elif out is None and has_display():
        recorder = Window(options.speed)
    else:
        out, why = (Path("view"), "no display here; ") if out is None else (out, "")
        recorder = pictures = Pictures(out, 1.0 if options.every is None else options.every, options.camera)
    if options.speed != 1 and not isinstance(recorder, Window):
        raise ConfigError("--speed without a window", got=options.speed, allowed="no --out, no --live")
    if options.every is not None and pictures is None:
        raise ConfigError("--every without pictures", got=options.every, allowed="with --out")
    result = play(
        options.suite, options.detector, options.controller, recorder,
        seed=options.seed, episode=options.episode, settings=options.set, camera=options.camera,
    )  # fmt: skip
    print(f"{result.outcome}, {result.sim_time_s:.1f} s")
    if pictures is not None:
        print(f"{why}Pictures: {len(pictures.files)} in {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
