"""`python -m mpgrasp.offline FOLDER`: a detector and a controller on a recording of a real camera."""

from __future__ import annotations

import argparse
import csv
import io
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mpgrasp.command_line import Parser, run_command
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.grasp import Grasp

_EPILOG = """\
FOLDER has camera.json, poses.csv and the depth images that this one names; docs/hardware.md says what is in
them. No simulator is loaded: what plays here is what would play on the robot's computer.

exit code: 0, 2 unusable input, 130 interrupted (Ctrl-C).
"""
COLUMNS = (
    "file", "time", "z", "peak", "vx", "vy", "vz", "yaw_rate", "done",
    "grasp_x", "grasp_y", "grasp_z", "grasp_angle", "grasp_width", "grasp_quality",
)  # fmt: skip
"""Of commands.csv; metres, seconds and radians, in the world."""


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run_command(lambda: _run(make_parser().parse_args(command)))


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = Parser(
        prog="python -m mpgrasp.offline",
        description="Show a detector and a controller the depth images of a recording, one after the "
        "other, and print what they would do.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("folder", metavar="FOLDER", type=Path, help="the recording")
    add("--detector", metavar="D", default="dhrnet", help="as for the benchmark (default: dhrnet)")
    add("--controller", metavar="C", default="mppc_robust", help="likewise (default: mppc_robust)")
    add("--weights", metavar="FILE", type=Path, help="of the detector, in place of the shipped ones")
    add("--out", metavar="FILE", type=Path, help="a CSV with everything, a row for each view")
    return parser


def _run(options: argparse.Namespace) -> int:
    from mpgrasp.detectors.detector import reads_truth
    from mpgrasp.offline.recorded import Recording
    from mpgrasp.offline.run import play
    from mpgrasp.plugins import load_controller, load_detector

    recording = Recording(options.folder)
    detector = load_detector(options.detector, options.weights)
    if reads_truth(detector):
        raise ConfigError(
            "nobody knows the truth of a recording", got=options.detector, allowed="detectors that look"
        )
    controller = load_controller(options.controller)
    rows: list[dict[str, Any]] = []
    grasp = None
    print(f"{'file':<16}{'z':>7}{'peak':>6}  {'velocity x, y, z [m/s]':<25}best grasp so far")
    try:
        for step in play(recording, detector, controller):
            row, grasp = _row(step), step.grasp
            rows.append(row)
            speed = ", ".join(f"{row[key]:+.3f}" for key in ("vx", "vy", "vz"))
            print(f"{row['file'][-15:]:<16}{row['z']:7.3f}{row['peak']:6.2f}  {speed:<25}{_words(grasp)}")
    finally:  # what was found before a broken image is not lost
        if options.out is not None and rows:
            _write(options.out, rows)
    ending = "done" if rows[-1]["done"] else f"not done after all {len(rows)} views"
    print(f"{controller.name} is {ending}; its grasp: {_words(grasp)}")
    return 0


def _row(step: Any) -> dict[str, Any]:
    twist, grasp = step.command.twist, step.grasp
    row: dict[str, Any] = dict.fromkeys(COLUMNS, "")
    row |= {"file": step.view.name, "time": step.view.frame.time, "z": float(step.view.T_world_tcp[2, 3])}
    row |= {"peak": step.peak, "done": int(step.command.done)}
    row |= dict(zip(("vx", "vy", "vz", "yaw_rate"), (float(twist[k]) for k in (0, 1, 2, 5)), strict=True))
    if grasp is not None:
        x, y, z = map(float, grasp.position)
        row |= {"grasp_x": x, "grasp_y": y, "grasp_z": z, "grasp_angle": grasp.angle}
        row |= {"grasp_width": grasp.width, "grasp_quality": grasp.quality}
    return row


def _words(grasp: Grasp | None) -> str:
    if grasp is None:
        return "none"
    x, y, z = grasp.position
    return (
        f"({x:.3f}, {y:.3f}, {z:.3f}) m, {np.degrees(grasp.angle):.0f} deg, {1000 * grasp.width:.0f} mm,"
        f" q {grasp.quality:.2f}"
    )


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    from mpgrasp.files.atomic import replace_file

    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS)
    writer.writeheader()
    writer.writerows(rows)
    try:
        replace_file(path, text.getvalue().encode())
    except OSError as error:
        raise OutputError(f"commands cannot be written ({error.strerror})", got=str(path)) from error


if __name__ == "__main__":
    sys.exit(main())
