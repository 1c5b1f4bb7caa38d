"""Settings of a training run."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import check_network
from mpgrasp.exceptions import ConfigError
from mpgrasp.training.augmentation import Augmentation


@dataclass(frozen=True, kw_only=True)
class LossConfig:
    """Weights of the parts."""

    positive: float = 3.0
    """Extra weight of a quality error at a pixel of label quality 1."""
    background: float = 0.05
    """Weight of cosine, sine and width where no grasp is labelled; 1 is the published code."""
    beta: float = 0.2
    """Error at which smooth-L1 turns from a parabola into a line; 1 is the published code."""
    quality_weight: float = 1.0
    """Weight of the quality against the angle and the width."""
    width_weight: float = 1.0
    """Weight of the width."""

    def __post_init__(self) -> None:
        _require(self, "a finite number above 0", lambda v: v > 0, "beta")
        weights = ("positive", "background", "quality_weight", "width_weight")
        _require(self, "a finite number from 0", lambda v: v >= 0, *weights)


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """Settings of a training."""

    name: str
    """Name of the network in the registry."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the network's config, beside its channels."""
    input: NetworkInput = field(default_factory=lambda: NetworkInput(centre="median", scale=20.0))
    """Form of the images that the network sees."""
    loss: LossConfig = field(default_factory=LossConfig)
    augmentation: Augmentation | None = field(default_factory=Augmentation)
    """None: images as they are."""
    epochs: float = 50.0
    """Passes over the data, where no minutes are given."""
    minutes: float | None = None
    """Time for everything, instead of epochs."""
    batch: int = 32
    """Images a step."""
    lr: float = 1e-4
    """Highest learning rate."""
    precision: str = "bfloat16"
    """Precision of the convolutions: "bfloat16", or "float32" where the processor does not know that."""
    schedule: str = "cosine"
    """"cosine" down to a hundredth, or "constant"; either after a warm-up. The paper names none."""
    weight_decay: float = 5e-2
    """AdamW's, of everything but biases, normalisations and relative positions."""
    average: float = 0.998
    """Decay per step of the running average of the weights; 0 saves the weights themselves."""
    thin_weight: float = 1.0
    """Factor by which images of thin objects are drawn more often."""
    images: int | None = None
    """Train on the first so many images only; None takes all."""
    seed: int = 0
    """Seed of initial weights, order and augmentation."""
    holdout: float = 0.08
    """Share of scenes for validation."""
    validation_images: int = 384
    """Largest number of images that are validated on."""
    lift_images: int = 48
    """Largest number of them that are also grasped in simulation, where the network would."""
    validate_every: float = 0.1
    """Share of the budget between validations."""

    def __post_init__(self) -> None:
        check_network(self.name)
        if self.schedule not in ("cosine", "constant"):
            raise ConfigError("unknown schedule", got=self.schedule, allowed=("cosine", "constant"))
        if self.precision not in ("bfloat16", "float32"):
            raise ConfigError("unknown precision", got=self.precision, allowed=("bfloat16", "float32"))
        above_0 = ("epochs", "minutes", "lr", "validate_every", "thin_weight")
        _require(self, "a finite number above 0", lambda v: v > 0, *above_0)
        _require(self, "a finite number from 0", lambda v: v >= 0, "weight_decay")
        _require(self, "from 0 to below 1", lambda v: 0 <= v < 1, "average")
        _require(self, "1 or more", lambda v: v >= 1, "batch", "images")
        _require(self, "0 or more", lambda v: v >= 0, "validation_images", "lift_images", "seed")


def _require(config: object, allowed: str, right: Callable[[float], bool], *names: str) -> None:
    """Raise ConfigError for the first of these fields that is neither None nor finite and right."""
    for name in names:
        value = getattr(config, name)
        if value is not None and not (math.isfinite(value) and right(value)):
            raise ConfigError(f"unusable {name}", got=value, allowed=allowed)
