"""A short training on few images, judged image by image on held-out ones after every epoch."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import study

from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from mpgrasp.training.dataset import GraspDataset
    from mpgrasp.training.metrics import LabelMatch
    from mpgrasp.training.trainer import Trainer

METRICS = ("rectangle", "hit")
CHUNK = 16
"""Images judged at a time."""
ESTIMATE_STEPS = 2
"""Timed for the estimate, after one to warm up."""


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One network of a study."""

    label: str
    name: str
    modality: str = "d"
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings that all networks of a study share."""

    epochs: int = 10
    """The paper's."""
    images: int = 800
    """To train on; Cornell has 885."""
    held_out: int = 400
    """To judge on."""
    batch: int = 32
    """Images a step."""
    lr: float = 1e-3
    """Highest learning rate: with the paper's 1e-4 ten epochs end before much is learnt."""

    def __post_init__(self) -> None:
        study.positive("size of an ablation", self.epochs, self.images, self.held_out, self.batch, self.lr)


def first_images(source: Path, images: int, links: Path, *, colour: bool) -> GraspDataset:
    """The data set of the first shards of a folder that hold so many images, linked in a folder of its own.

    Raises:
        ConfigError: the folder holds fewer images.
    """
    from mpgrasp.training.dataset import GraspDataset

    links.mkdir(parents=True)
    count = 0
    for shard in sorted(source.glob("shard_*.npz")):
        if count >= images:
            break
        with np.load(shard) as arrays:
            count += len(arrays["meta"])
        (links / shard.name).symlink_to(shard.resolve())
    if count < images:
        raise ConfigError("not enough images", got=f"{count} in {source}", allowed=f"{images} or more")
    (links / "meta.json").symlink_to((source / "meta.json").resolve())
    return GraspDataset([links], holdout=0, colour=colour, images=images)


def make_trainer(
    variant: Variant, settings: Settings, seed: int, data: GraspDataset, held_out: GraspDataset, out: Path
) -> Trainer:
    """The trainer of one run; the paper's optimiser, and the package's augmentation and loss."""
    from mpgrasp.training.trainer import Trainer
    from mpgrasp.training.trainer_config import TrainConfig

    config = TrainConfig(
        name=variant.name,
        settings=variant.settings,
        epochs=settings.epochs,
        batch=settings.batch,
        lr=settings.lr,
        seed=seed,
        validate_every=1.0,
        validation_images=1,  # judged here instead, epoch by epoch and image by image
        lift_images=0,
    )
    config = replace(config, input=replace(config.input, modality=variant.modality))
    return Trainer(config, data, out, held_out)


def train(trainer: Trainer, epochs: int, images: np.ndarray) -> dict[str, Any]:
    """Train for some epochs and judge the averaged weights on the images after each of them.

    Keys: parameters, minutes, curve (an entry per epoch: epoch, rectangle, hit, each as `study.rate`), and
    the last epoch's answers rectangle and hit, a truth value per image.
    """
    from mpgrasp.training.progress import ProgressLog

    started, steps, curve = time.monotonic(), trainer.total_steps, []
    with ProgressLog(quiet=True) as log:
        for epoch in range(1, epochs + 1):
            trainer.run(log, stop_after=round(steps * epoch / epochs) - trainer.step)
            answers = _answers(judged(trainer, images))
            point = {metric: study.rate(sum(answers[metric]), len(images)) for metric in METRICS}
            curve.append({"epoch": epoch, **point})
    minutes = (time.monotonic() - started) / 60
    return {"parameters": trainer.parameters, "minutes": round(minutes, 2), "curve": curve, **answers}


def judged(trainer: Trainer, images: np.ndarray) -> list[LabelMatch]:
    """Verdicts on held-out images, of the running average of the weights."""
    import torch

    from mpgrasp.detectors.network_detector import postprocess
    from mpgrasp.training.metrics import match_labels

    network = copy.deepcopy(trainer.network)
    network.load_state_dict(trainer.average)
    network.eval()
    verdicts = []
    for chunk in np.array_split(images, max(1, -(-len(images) // CHUNK))):
        batch = torch.from_numpy(trainer.validation.batch(chunk, trainer.config.input).image)
        on_device = batch.to(trainer.device).contiguous(memory_format=torch.channels_last)
        with torch.inference_mode(), torch.autocast(trainer.device.type, torch.bfloat16):
            heads = torch.cat(network(on_device), dim=1).float().cpu().numpy()
        for i, of_image in zip(chunk.tolist(), heads, strict=True):
            truth = trainer.validation.sample(i).resized(trainer.config.input.size)
            verdicts.append(match_labels(*postprocess(of_image, trainer.weights.width_px), truth))
    return verdicts


def _answers(verdicts: Sequence[LabelMatch]) -> dict[str, list[bool]]:
    return {metric: [bool(getattr(v, metric)) for v in verdicts] for metric in METRICS}


def seconds_per_run(trainer: Trainer, epochs: int, images: int) -> float:
    """About how long that training and its judging will take [s]; the trainer is used up."""
    from mpgrasp.training.progress import ProgressLog

    log = ProgressLog(quiet=True)
    trainer.run(log, stop_after=1)
    start, before = time.perf_counter(), trainer.step
    trainer.run(log, stop_after=ESTIMATE_STEPS)
    a_step = (time.perf_counter() - start) / max(1, trainer.step - before)
    start = time.perf_counter()
    some = np.arange(min(CHUNK, images))
    judged(trainer, some)
    an_image = (time.perf_counter() - start) / len(some)
    return trainer.total_steps * a_step + epochs * images * an_image


def graspable(dataset: GraspDataset, most: int) -> np.ndarray:
    """Numbers of the first images that have a labelled grasp, at most so many."""
    found = (i for i in range(len(dataset)) if dataset.sample(i).quality.any())
    return np.array([i for i, _ in zip(found, range(most), strict=False)], int)
