"""`python -m mpgrasp.evaluate cornell|jacquard PATH`: detectors on real datasets, by the rectangle metric."""

from __future__ import annotations

import argparse
import csv
import dataclasses
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp.command_line import COUNT, Parser, number, run_command
from mpgrasp.exceptions import ConfigError, OutputError

if TYPE_CHECKING:
    from mpgrasp.datasets.reader import Reader
    from mpgrasp.detectors.detector import GraspDetector
    from mpgrasp.evaluate.scores import ImageScore

DATASETS = ("cornell", "jacquard")
_EPILOG = """\
examples:
  python -m mpgrasp.evaluate cornell /data/cornell --detector dhrnet,ggcnn --limit 100
  python -m mpgrasp.evaluate jacquard /data/jacquard --detector ggcnn --weights ggcnn=ggcnn_statedict.pt
  python -m mpgrasp.evaluate cornell /data/cornell --detector my_net:MyDetector --side 350 --out out/cornell

A grasp is right if its rectangle overlaps a labelled one by more than 25 % (intersection over union) and
turns from it by less than 30 degrees. Told are the shares of images whose best grasp is right, and of those
in which one of the best five is, with 95 % Wilson intervals, and exact McNemar tests of every two detectors.

What an image lacks, or what cannot be read, is said and left out, or with --strict ends the command. Nothing
is written but into --out: evaluation.json, images.csv with a row per image and detector, and worst.png.
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.evaluate",
        description="Score detectors on a real grasping dataset.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("dataset", choices=DATASETS, help="kind of the dataset")
    add("path", type=Path, help="folder of the dataset")
    add("--detector", metavar="D[,D]", default="dhrnet", help="as for `mpgrasp.bench` (default: dhrnet)")
    add("--weights", metavar="[D=]FILE", action="append", default=[], help="as for `mpgrasp.bench`")
    add("--runtime", metavar="R", default="auto", help="what computes the networks (default: auto)")
    add(
        "--side",
        metavar="PX",
        type=number(32, 4096, "px"),
        help="look at a square of that side around the labels; default: the largest square in the middle",
    )
    add("--depth", metavar="KIND", default="stereo", help="jacquard: stereo or perfect (default: stereo)")
    add("--limit", metavar="N", type=COUNT, help="images to score (default: all)")
    add("--strict", action="store_true", help="end at the first image that cannot be used")
    add("--out", metavar="DIR", type=Path, help="folder of the results (default: none are written)")
    return parser


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    os.environ.setdefault("OMP_NUM_THREADS", str(len(os.sched_getaffinity(0))))
    return run_command(lambda: _run(sys.argv[1:] if command is None else command))


def _run(command: Sequence[str]) -> int:
    options = make_parser().parse_args(command)
    from mpgrasp.datasets.reader import Skipped, usable
    from mpgrasp.evaluate.predict import square
    from mpgrasp.evaluate.scores import score

    reader, detectors = _reader(options), _detectors(options)
    skipped, rows = Skipped(), list[Any]()
    worst = _Worst()
    for image in usable(reader, skipped, limit=options.limit, strict=options.strict):
        seen = square(image, options.side)
        found = score(detectors, seen)
        rows += found
        worst.see(seen, found)
    print(f"{reader.title}: {len(rows) // len(detectors)} images; {skipped}")
    _print(rows, list(detectors))
    if options.out is not None:
        _write(options, command, rows, skipped.reasons, worst)
    return 0


def _reader(options: argparse.Namespace) -> Reader:
    from mpgrasp.datasets.cornell import Cornell
    from mpgrasp.datasets.jacquard import DEPTHS, Jacquard

    if not options.path.is_dir():
        raise ConfigError("no such folder", got=str(options.path), allowed=f"the folder of {options.dataset}")
    if options.depth not in DEPTHS:
        raise ConfigError("unknown depth of Jacquard", got=options.depth, allowed=DEPTHS)
    return Cornell(options.path) if options.dataset == "cornell" else Jacquard(options.path, options.depth)


def _detectors(options: argparse.Namespace) -> dict[str, GraspDetector]:
    from mpgrasp.detectors.detector import reads_truth
    from mpgrasp.plugins import load_detector, parse_weights

    names = options.detector.split(",")
    if not all(names) or len(set(names)) < len(names):
        raise ConfigError("unusable list of detectors", got=options.detector, allowed="different detectors")
    weights = parse_weights(options.weights, names)
    made = {name: load_detector(name, weights.get(name), options.runtime) for name in names}
    for name, detector in made.items():
        if reads_truth(detector):
            raise ConfigError("a dataset has no true shape to tell", got=name, allowed="other detectors")
    return made


def _print(rows: Sequence[ImageScore], names: Sequence[str]) -> None:
    from rich.console import Console
    from rich.table import Table

    from mpgrasp.evaluate.scores import TOP, paired_tests, rates

    table = Table("detector")
    for heading in ("best grasp right %", f"one of {TOP} right %", "best at the border %"):
        table.add_column(heading, justify="right")
    for name in names:
        table.add_row(name, *map(str, rates(rows, name).values()))
    console = Console()
    console.print(table)
    for test in paired_tests(rows):
        console.print(
            f"{test.a} and {test.b}: alone {test.a_alone} and {test.b_alone}, Holm p {test.p_holm:.3g}",
            highlight=False,
        )


def _write(
    options: argparse.Namespace,
    command: Sequence[str],
    rows: Sequence[ImageScore],
    skipped: dict[str, str],
    worst: _Worst,
) -> None:
    from mpgrasp.bench.results.provenance import provenance
    from mpgrasp.evaluate.scores import paired_tests, rates
    from mpgrasp.files.json_values import json_value

    names = list(dict.fromkeys(row.detector for row in rows))
    told = {
        "command": " ".join(["python", "-m", "mpgrasp.evaluate", *command]),
        "dataset": options.dataset,
        "rates": {
            name: {
                key: {"count": rate.count, "n": rate.n, "interval": rate.interval}
                for key, rate in rates(rows, name).items()
            }
            for name in names
        },
        "paired_tests": [dataclasses.asdict(test) for test in paired_tests(rows)],
        "skipped": skipped,
        "made_with": provenance(),
    }
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "evaluation.json").write_text(json.dumps(json_value(told), indent=1) + "\n", "utf-8")
        with (options.out / "images.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, [field.name for field in dataclasses.fields(rows[0])])
            writer.writeheader()
            writer.writerows(dataclasses.asdict(row) for row in rows)
        worst.save(options.out / "worst.png")
    except OSError as error:
        raise OutputError(f"results cannot be written: {error}", got=str(options.out)) from error
    print(f"Results: {options.out}")


class _Worst:
    """Images of which the detectors got least, for a sheet."""

    MOST = 12

    def __init__(self) -> None:
        self._images: list[tuple[int, float, Any]] = []

    def see(self, image: Any, rows: Sequence[ImageScore]) -> None:
        """Keep an image if it is among the worst."""
        wrong = [row for row in rows if not row.top1]
        if wrong:
            self._images.append((-len(wrong), min(row.iou for row in wrong), image))
            self._images = sorted(self._images, key=lambda entry: entry[:2])[: self.MOST]

    def save(self, path: Path) -> None:
        """Write the sheet: depth with the labels, four images in a row."""
        import cv2
        import numpy as np

        from mpgrasp.recording.false_colour import shade

        tiles = []
        for _, _, image in self._images:
            low, high = np.nanpercentile(image.depth, (1, 99))
            tile = shade(-np.nan_to_num(image.depth, nan=float(high)).astype(float), -high, -low).copy()
            for rectangle in image.rectangles:
                corners = rectangle.corners().round().astype(np.int32)
                cv2.polylines(tile, [corners.reshape(-1, 1, 2)], True, (255, 255, 255), 1)
            tiles.append(cv2.resize(tile, (300, 300)))
        if not tiles:
            return
        while len(tiles) % 4:
            tiles.append(np.full((300, 300, 3), 255, np.uint8))
        sheet = np.vstack([np.hstack(tiles[k : k + 4]) for k in range(0, len(tiles), 4)])
        ok, data = cv2.imencode(".png", sheet[..., ::-1])
        assert ok
        path.write_bytes(data.tobytes())


if __name__ == "__main__":
    sys.exit(main())
