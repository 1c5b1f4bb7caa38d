"""`python -m mpgrasp.training train NAME --data DIR --out FILE`: train a network on generated shards."""

from __future__ import annotations

import argparse
import json
import shlex
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp.command_line import SEED, THREADS, number, whole
from mpgrasp.detectors.networks.input import CHANNELS, NetworkInput
from mpgrasp.detectors.networks.registry import NETWORKS, declaration
from mpgrasp.exceptions import ConfigError
from mpgrasp.training.trainer_config import TrainConfig

if TYPE_CHECKING:
    from mpgrasp.training.trainer import Trainer

NOT_OPTIONS = ("name", "command", "run", "default_of", "track")
"""Names in parsed arguments that are not options of this command, or decide nothing."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `python -m mpgrasp.training train`; defaults are TrainConfig's."""
    defaults = TrainConfig(name="dhrnet")
    loss, image = defaults.loss, defaults.input
    parser.set_defaults(default_of=parser.get_default)
    add = parser.add_argument
    add("name", help="network: " + ", ".join(NETWORKS))
    add("--data", type=Path, nargs="+", required=True, metavar="DIR", help="directories of shards")
    add(
        "--validation",
        type=Path,
        nargs="+",
        metavar="DIR",
        help="directories to validate on (default: held out)",
    )
    add("--out", type=Path, metavar="FILE", help="weights file (default: out/NAME.safetensors)")
    add("--curves", type=Path, metavar="DIR", help="where the curves go (default: beside the weights)")
    add(
        "--input",
        default=image.modality,
        choices=tuple(CHANNELS),
        help="depth, colour or both (default: %(default)s)",
    )
    add(
        "--from", dest="start", type=Path, metavar="FILE", help="weights to go on from (default: random ones)"
    )
    add("--settings", default="{}", metavar="JSON", help="of the network, such as '{\"width\": 48}'")
    add(
        "--epochs",
        type=number(0, 1e5, above=True),
        default=defaults.epochs,
        help="passes over the data (default: %(default)s)",
    )
    add("--minutes", type=number(0, 1e6, above=True), help="time for everything, instead of epochs")
    add("--batch", type=whole(1, 65536), default=defaults.batch, help="images a step (default: %(default)s)")
    add(
        "--lr",
        type=number(0, 100, above=True),
        default=defaults.lr,
        help="highest learning rate (default: %(default)s)",
    )
    add("--schedule", default=defaults.schedule, help="cosine or constant (default: %(default)s)")
    add(
        "--weight-decay",
        type=number(0, 100),
        default=defaults.weight_decay,
        help="AdamW's (default: %(default)s)",
    )
    add(
        "--average",
        type=number(0, 1),
        default=defaults.average,
        help="decay of the averaged weights, 0 = none",
    )
    add(
        "--positive",
        type=number(0, 1e6),
        default=loss.positive,
        help="extra weight of labelled pixels' quality",
    )
    add(
        "--background",
        type=number(0, 1e6),
        default=loss.background,
        help="weight of angle and width elsewhere",
    )
    add(
        "--beta",
        type=number(0, 1e6, above=True),
        default=loss.beta,
        help="bend of smooth-L1 (default: %(default)s)",
    )
    add("--centre", default=image.centre, help="of the input's depth: mean or median (default: %(default)s)")
    add(
        "--scale",
        type=number(0, 1e6, above=True),
        default=image.scale,
        help="input units a metre (default: %(default)s)",
    )
    add("--no-augmentation", action="store_true", help="images as they are")
    add(
        "--thin-weight",
        type=number(0, 1e6, above=True),
        default=defaults.thin_weight,
        help="how much oftener thin scenes are drawn",
    )
    add("--precision", default=defaults.precision, help="bfloat16 or float32 (default: %(default)s)")
    add("--images", type=whole(1, 10**9), metavar="N", help="train on the first N images only")
    add("--holdout", type=number(0, 1), default=defaults.holdout, help="share of scenes to validate on")
    add(
        "--validation-images",
        type=whole(0, 10**9),
        default=defaults.validation_images,
        help="validate on so many images (default: %(default)s)",
    )
    add(
        "--lift-images",
        type=whole(0, 10**9),
        default=defaults.lift_images,
        help="grasp so many of them in simulation, 0 = none (default: %(default)s)",
    )
    add(
        "--validate-every",
        type=number(0, 1e6, above=True),
        default=defaults.validate_every,
        help="share of the budget between validations (default: %(default)s)",
    )
    add("--seed", type=SEED, default=defaults.seed, help="of weights, order and augmentation")
    add("--threads", type=THREADS, help="threads for the network (default: all cores)")
    add("--track", metavar="T", help="draw curves in tensorboard or wandb while it lasts, where installed")
    add("--resume", action="store_true", help="continue from the checkpoint beside the weights file")


def main(args: argparse.Namespace) -> int:
    """Run the command and return its exit code. Ctrl-C keeps what was learnt so far.

    Raises:
        MpgraspError: unusable options, data or files.
    """
    config = config_from(args)
    if args.threads is not None and args.threads < 1:
        raise ConfigError("unusable number of threads", got=args.threads, allowed="1 or more")
    import torch

    from mpgrasp.files.json_values import json_value
    from mpgrasp.training.dataset import GraspDataset
    from mpgrasp.training.heap import keep_memory
    from mpgrasp.training.progress import ProgressLog
    from mpgrasp.training.tracking import make_tracker
    from mpgrasp.training.trainer import Trainer

    keep_memory()
    if args.threads is not None:
        torch.set_num_threads(args.threads)
    out: Path = args.out or Path("out", f"{config.name}.safetensors")
    colour = config.input.reads_colour
    separate = GraspDataset(args.validation, holdout=0, colour=colour) if args.validation else None
    dataset = GraspDataset(
        args.data, holdout=0 if separate else config.holdout, colour=colour, images=config.images
    )
    curves = args.curves / f"{out.stem}.csv" if args.curves else None
    trainer = Trainer(
        config, dataset, out, separate, curves=curves, command=command_line(args), start=args.start
    )
    tracker = None
    if args.track is not None:
        tracker = make_tracker(args.track, out, json_value(config))
    with ProgressLog(tracker=tracker) as log:
        resumed = args.resume and trainer.resume()
        log.note(
            f"{config.name}: {trainer.parameters / 1e6:.2f} M parameters, {len(dataset.training)} images of "
            f"{dataset.scene_count} scenes to train on, {len(trainer.validator.images)} to validate on"
            + (f"; resumed at step {trainer.step}" if resumed else "")
        )
        with _stopping(trainer):
            best = trainer.run(log)
        if trainer.progress < 1:
            log.note(f"stopped at step {trainer.step}; continue with --resume")
            return 130
    print(json.dumps({"weights": str(out), "steps": trainer.step, "validation": best}))
    return 0


@contextmanager
def _stopping(trainer: Trainer) -> Iterator[None]:
    """Let the first Ctrl-C or SIGTERM end the run between two steps, so that it resumes to the bit."""

    def stop(signum: int, frame: object) -> None:
        trainer.stop()
        restore()

    before = {which: signal.getsignal(which) for which in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for which, handler in before.items():
            signal.signal(which, handler)

    for which in before:
        signal.signal(which, stop)
    try:
        yield
    finally:
        restore()


def command_line(args: argparse.Namespace) -> str:
    """Return the command that the arguments stand for, without what is at its default."""
    words = ["python", "-m", "mpgrasp.training", "train", args.name]
    for name, value in vars(args).items():
        if name in NOT_OPTIONS or value == args.default_of(name):
            continue
        values = value if isinstance(value, list) else [] if value is True else [value]
        option = "from" if name == "start" else name.replace("_", "-")
        words += [f"--{option}", *map(str, values)]
    return shlex.join(words)


def config_from(args: argparse.Namespace) -> TrainConfig:
    """Return the training's settings from the command line's.

    Raises:
        ConfigError: settings that cannot be used.
    """
    from mpgrasp.training.augmentation import Augmentation
    from mpgrasp.training.trainer_config import LossConfig

    try:
        settings: Any = json.loads(args.settings)
    except json.JSONDecodeError as error:
        raise ConfigError(f"settings are not JSON: {error}", got=args.settings) from error
    if not isinstance(settings, dict):
        raise ConfigError("settings are not a JSON object", got=args.settings, allowed='{"width": 48}')
    return TrainConfig(
        name=args.name,
        settings=settings,
        input=NetworkInput(
            size=declaration(args.name).input_size,
            modality=args.input,
            centre=args.centre,
            scale=args.scale,
        ),
        loss=LossConfig(positive=args.positive, background=args.background, beta=args.beta),
        augmentation=None if args.no_augmentation else Augmentation(),
        epochs=args.epochs,
        minutes=args.minutes,
        batch=args.batch,
        lr=args.lr,
        schedule=args.schedule,
        weight_decay=args.weight_decay,
        average=args.average,
        precision=args.precision,
        thin_weight=args.thin_weight,
        images=args.images,
        validation_images=args.validation_images,
        lift_images=args.lift_images,
        validate_every=args.validate_every,
        seed=args.seed,
        holdout=args.holdout,
    )
