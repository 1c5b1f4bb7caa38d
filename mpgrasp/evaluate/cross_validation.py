"""Training of networks on a dataset, fold by fold, and their test on the fold that they never saw."""

from __future__ import annotations

import hashlib
import json
import shutil
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp.datasets.folds import members
from mpgrasp.datasets.reader import Reader, Skipped, Subset, usable
from mpgrasp.datasets.training_shards import write_training_shards
from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.detectors.networks.registry import check_network
from mpgrasp.evaluate.options import detector_list, network_settings
from mpgrasp.evaluate.predict import square
from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from mpgrasp.training.trainer_config import TrainConfig

VALIDATE_EVERY = 0.1
"""Share of the budget between validations; the best weights by them are kept."""


def trained_folds(
    options: Namespace, reader: Reader, folds: Mapping[str, int], command: str
) -> Iterator[tuple[int, Subset, dict[str, GraspDetector]]]:
    """Train every network on all folds but one, and yield that fold, from 0, with the trained detectors.

    Shards, weights and checkpoints are kept in `--out`; what is there already is not made again.

    Raises:
        ConfigError: a detector that is no network, or data that cannot be trained on.
        OutputError: `--out` cannot be written.
    """
    from mpgrasp.detectors.network_detector import NetworkDetector

    names, _ = detector_list(options)
    for name in names:
        check_network(name)
    of_fold = members(folds, options.folds)
    wanted = range(options.folds) if options.fold is None else (options.fold - 1,)
    data = _shards(options, reader, of_fold)
    for which in wanted:
        made: dict[str, GraspDetector] = {}
        for name in names:
            stem = f"{name}-{options.channels or 'd'}-{options.split}-{which + 1}-of-{options.folds}"
            weights = options.out / "folds" / f"{stem}.safetensors"
            _train(options, name, data, which, weights, command)
            made[name] = NetworkDetector.load(name, weights, runtime=options.runtime)
        yield which, Subset(reader, of_fold[which]), made


def _shards(options: Namespace, reader: Reader, of_fold: Sequence[Sequence[str]]) -> list[Path]:
    """Return a folder of training shards for each fold; those that are whole are kept.

    Raises:
        ConfigError: shards that were made of other images, or in another way.
    """
    folders = []
    for k, names in enumerate(of_fold):
        folder = options.out / "shards" / f"{options.split}-{k + 1}-of-{options.folds}"
        digest = hashlib.sha256("\n".join(names).encode()).hexdigest()[:12]
        source = f"{reader.title}, fold {k + 1} of {options.folds}, {len(names)} images ({digest})"
        source += f", side {options.side or 'whole'}" + (", levelled" if options.level else "")
        there = folder / "meta.json"
        if there.is_file():
            told = json.loads(there.read_text(encoding="utf-8")).get("source")
            if told != source:
                raise ConfigError(f"{folder} holds other training images", got=told, allowed=source)
        else:
            shutil.rmtree(folder, ignore_errors=True)
            images = usable(Subset(reader, names), Skipped(), strict=options.strict)
            labelled = (image for image in images if image.rectangles)
            squares = (
                square(image, options.side, NETWORK_SIZE, levelled=options.level).image for image in labelled
            )
            write_training_shards(squares, folder, source)
        folders.append(folder)
    return folders


def _train(
    options: Namespace, name: str, data: Sequence[Path], test: int, weights: Path, command: str
) -> None:
    """Train a network on all folds but one; what was begun goes on."""
    import torch

    from mpgrasp.training.dataset import GraspDataset
    from mpgrasp.training.heap import keep_memory
    from mpgrasp.training.progress import ProgressLog
    from mpgrasp.training.trainer import Trainer

    keep_memory()
    if options.threads is not None:
        torch.set_num_threads(options.threads)
    config = _config(options, name)
    colour = config.input.reads_colour
    others = [folder for k, folder in enumerate(data) if k != test]
    dataset = GraspDataset(others, holdout=0.1, colour=colour)
    trainer = Trainer(config, dataset, weights, command=command)
    with ProgressLog() as log:
        trainer.resume()
        if trainer.progress < 1:
            log.note(f"{weights.stem}: {len(dataset.training)} images to train on")
            trainer.run(log)
    if not weights.is_file():
        raise ConfigError("a training that kept no weights", got=name, allowed="more --epochs")


def _config(options: Namespace, name: str) -> TrainConfig:
    from mpgrasp.detectors.networks.input import NetworkInput
    from mpgrasp.detectors.networks.registry import declaration
    from mpgrasp.training.trainer_config import TrainConfig

    settings: dict[str, Any] = {
        key: getattr(options, key) for key in ("epochs", "batch", "lr", "precision", "seed")
    }
    image = NetworkInput(
        size=declaration(name).input_size, modality=options.channels or "d", centre="median", scale=20.0
    )
    return TrainConfig(
        name=name,
        settings=network_settings(options),
        input=image,
        lift_images=0,
        validate_every=VALIDATE_EVERY,
        **settings,
    )
