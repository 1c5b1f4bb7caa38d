"""Options of `python -m mpgrasp.evaluate`, and what they name: the dataset and the detectors."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp.command_line import COUNT, SEED, THREADS, Parser, number, whole
from mpgrasp.exceptions import ConfigError
from mpgrasp.plugin_names import detectors_of

if TYPE_CHECKING:
    from mpgrasp.datasets.reader import Reader
    from mpgrasp.detectors.detector import GraspDetector

DATASETS = ("cornell", "jacquard", "multi", "synthetic", "frames")
CHANNELS = ("d", "rgb", "rgbd")
_OF_TRAINING = ("epochs", "batch", "lr", "precision", "settings", "seed", "threads", "fold")
"""Options that have an effect with --train alone."""
_EPILOG = """\
datasets:
  cornell    the Cornell grasping dataset
  jacquard   the Jacquard dataset
  multi      the multi-object dataset of Chu et al.
  synthetic  shards of `python -m mpgrasp.training generate`
  frames     depth images of your own (TIFF, PNG, npy), with labels NAME_grasps.txt or without

examples:
  python -m mpgrasp.evaluate cornell /data/cornell --detector dhrnet,ggcnn --limit 100
  python -m mpgrasp.evaluate jacquard /data/jacquard --detector ggcnn --weights ggcnn=ggcnn_statedict.pt
  python -m mpgrasp.evaluate cornell /data/cornell --detector my_net:MyDetector --side 350 --out out/cornell
  python -m mpgrasp.evaluate cornell /data/cornell --detector dhrnet --split ow --train --channels rgbd \\
      --side 350 --out out/table-2
  python -m mpgrasp.evaluate frames my_frames --detector dhrnet --out out/frames

A grasp is right if its rectangle overlaps a labelled one by more than 25 % (intersection over union) and
turns from it by less than 30 degrees. Told are the shares of images whose best grasp is right, and of those
in which one of the best five is, with 95 % Wilson intervals, and exact McNemar tests of every two detectors.

--split tells mean and standard deviation over folds, image-wise or object-wise. With --train every network
is trained on the other folds and tested on each, by the paper's recipe unless told otherwise; a command that
was stopped goes on where it was, and --fold plays one fold alone, so that folds can be shared out.

What an image lacks, or what cannot be read, is said and left out, or with --strict ends the command. Nothing
is written but into --out: report.html, evaluation.json, images.csv with a row per image and detector,
folds.json, predictions.png and worst.png, and what is trained.
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.evaluate",
        description="Score detectors on a grasping dataset, or train them on it first.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("dataset", choices=DATASETS, help="kind of the dataset")
    add("path", type=Path, help="folder of the dataset")
    add("--detector", metavar="D[,D]", default="dhrnet", help="as for `mpgrasp.bench` (default: dhrnet)")
    add("--weights", metavar="[D=]FILE", action="append", default=[], help="as for `mpgrasp.bench`")
    add("--runtime", metavar="R", default="auto", help="what computes the networks (default: auto)")
    add(
        "--channels",
        choices=CHANNELS,
        help="depth, colour or both: what is trained (default: d), or what weights must read",
    )
    add(
        "--side",
        metavar="PX",
        type=number(32, 4096, "px"),
        help="look at a square of that side around the labels; default: the largest square in the middle",
    )
    add(
        "--level", action="store_true", help="level the table first, for a camera that looks aslant (Cornell)"
    )
    add("--depth", metavar="KIND", default="stereo", help="jacquard: stereo or perfect (default: stereo)")
    add("--focal", metavar="PX", type=number(1, 1e5, "px"), help="frames: focal length of the camera")
    add("--limit", metavar="N", type=COUNT, help="images to score (default: all)")
    add("--strict", action="store_true", help="end at the first image that cannot be used")
    add("--split", choices=("iw", "ow"), help="folds by image or by object")
    add("--folds", metavar="K", type=whole(2, 100), default=5, help="number of folds (default: 5)")
    add("--train", action="store_true", help="train on the other folds, then test on each; needs --split")
    add("--fold", metavar="K", type=whole(1, 100), help="train and test this fold alone, from 1")
    add(
        "--epochs",
        metavar="N",
        type=number(0, 1e5, above=True),
        default=50.0,
        help="of a training (default: 50, the paper's)",
    )
    add("--batch", metavar="N", type=whole(1, 65536), default=32, help="images a step (default: 32)")
    add(
        "--lr",
        metavar="R",
        type=number(0, 100, above=True),
        default=1e-4,
        help="highest learning rate (default: 1e-4)",
    )
    add("--precision", choices=("bfloat16", "float32"), default="bfloat16", help="(default: bfloat16)")
    add(
        "--settings",
        default="{}",
        metavar="JSON",
        help="of the network that is trained, such as '{\"width\": 48}'",
    )
    add("--seed", metavar="S", type=SEED, default=0, help="of a training (default: 0)")
    add("--threads", metavar="N", type=THREADS, help="for a training (default: all cores)")
    add("--out", metavar="DIR", type=Path, help="folder of the results (default: none are written)")
    return parser


def network_settings(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of the networks that are trained.

    Raises:
        ConfigError: they are no JSON object.
    """
    try:
        settings = json.loads(options.settings)
    except json.JSONDecodeError as error:
        raise ConfigError(f"--settings is not JSON: {error}", got=options.settings) from error
    if not isinstance(settings, dict):
        raise ConfigError("--settings is no JSON object", got=options.settings, allowed='{"width": 48}')
    return settings


def check(options: argparse.Namespace) -> None:
    """Make sure that options go together.

    Raises:
        ConfigError: they do not.
    """
    if options.train and (options.split is None or options.out is None):
        missing = "--split" if options.split is None else "--out"
        raise ConfigError(f"--train without {missing}", allowed="--train --split iw|ow --out DIR")
    if options.train and options.weights:
        raise ConfigError("--weights with --train", got=options.weights[0], allowed="one of both")
    network_settings(options)
    if options.fold is not None and options.fold > options.folds:
        raise ConfigError("unusable --fold", got=options.fold, allowed="1 to --folds")
    without_effect = {
        "--train": () if options.train else _OF_TRAINING,
        "--split": ("folds",) if options.split is None else (),
        "jacquard": () if options.dataset == "jacquard" else ("depth",),
        "frames": () if options.dataset == "frames" else ("focal",),
    }
    parser = make_parser()
    for other, names in without_effect.items():
        for name in names:
            value = getattr(options, name)
            if value != parser.get_default(name):
                raise ConfigError(f"--{name} without {other}", got=value, allowed="both or none")
    if not options.path.is_dir():
        raise ConfigError("no such folder", got=str(options.path), allowed=f"the folder of {options.dataset}")


def reader_of(options: argparse.Namespace) -> Reader:
    """Return the dataset that options name.

    Raises:
        ConfigError: it is not there.
    """
    from mpgrasp.datasets.jacquard import DEPTHS

    if options.depth not in DEPTHS:
        raise ConfigError("unknown depth of Jacquard", got=options.depth, allowed=DEPTHS)
    if options.dataset == "cornell":
        from mpgrasp.datasets.cornell import Cornell

        return Cornell(options.path)
    if options.dataset == "jacquard":
        from mpgrasp.datasets.jacquard import Jacquard

        return Jacquard(options.path, options.depth)
    if options.dataset == "multi":
        from mpgrasp.datasets.multi_object import MultiObject

        return MultiObject(options.path)
    if options.dataset == "synthetic":
        from mpgrasp.datasets.generated import Generated

        return Generated(options.path)
    from mpgrasp.datasets.depth_folder import DepthFolder

    return DepthFolder(options.path, options.focal)


def detector_list(options: argparse.Namespace) -> tuple[list[str], dict[str, Path]]:
    """Return the names of the detectors, and the weights that they bring.

    Raises:
        ConfigError: one of them is empty or there twice.
    """
    names, own = detectors_of(options.detector)
    if not all(names) or len(set(names)) < len(names):
        raise ConfigError("unusable list of detectors", got=options.detector, allowed="different detectors")
    return names, own


def make_detectors(options: argparse.Namespace) -> dict[str, GraspDetector]:
    """Return the detectors that options name.

    Raises:
        ConfigError, WeightsError: one of them cannot be used.
    """
    from mpgrasp.detectors.detector import reads_colour, reads_truth
    from mpgrasp.plugins import load_detector, parse_weights

    names, own = detector_list(options)
    weights = parse_weights(options.weights, names, own)
    made = {name: load_detector(name, weights.get(name), options.runtime) for name in names}
    for name, detector in made.items():
        if reads_truth(detector):
            raise ConfigError("a dataset has no true shape to tell", got=name, allowed="other detectors")
        if options.channels is not None and reads_colour(detector) != (options.channels != "d"):
            reads = "colour" if reads_colour(detector) else "depth alone"
            raise ConfigError(f"{name} reads {reads}", got=f"--channels {options.channels}")
    return made
