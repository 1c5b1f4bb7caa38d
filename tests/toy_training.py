"""Trainings of a small network on toy shards, which take seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from toy_shards import toy_image

from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.training.augmentation import Sample
from mpgrasp.training.data.labels import decode_angle, decode_depth
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.trainer import Trainer
from mpgrasp.training.trainer_config import TrainConfig

INPUT = NetworkInput(size=64, centre="median", scale=20.0)
SMALL = {"width": 8, "stem_width": 8, "head_width": 8, "blocks": 1, "fine_head": False}


def config(**changes: object) -> TrainConfig:
    """Settings of a training that takes seconds, but for these changes."""
    settings = {"name": "dhrnet", "settings": SMALL, "batch": 8, "lr": 5e-3, "epochs": 1.0, "holdout": 0.25}
    toys = {"input": INPUT, "lift_images": 0, "validate_every": 0.5}
    return TrainConfig(**{**settings, **toys, **changes})  # type: ignore[arg-type]


def trainer(shards: Path, out: Path, **changes: object) -> Trainer:
    """A training on shards, with those settings."""
    settings = config(**changes)
    colour = settings.input.reads_colour
    dataset = GraspDataset([shards], holdout=settings.holdout, colour=colour, images=settings.images)
    return Trainer(settings, dataset, out)


def toy_sample(seed: int = 0) -> Sample:
    """Image and labels of one toy bar."""
    toy = toy_image(np.random.default_rng(seed))
    return Sample(
        depth=np.nan_to_num(decode_depth(toy["depth"]), nan=0.4),
        quality=(toy["quality"] / 255).astype(np.float32),
        angle=decode_angle(toy["angle"]),
        width=toy["width"].astype(np.float32),
        valid=np.ones(toy["depth"].shape, bool),
    )
