"""Smooth-L1 losses on the four heads, as in the published code, with two changes that sparse labels ask for.

The published code regresses zeros for cosine, sine and width wherever there is no grasp. Here these three
count in full only where a grasp is labelled and by `background` elsewhere: enough that smoothing does not
mix in arbitrary values from beside an object, too little to pull the angles of thin objects towards zero.
And the quality of labelled pixels counts more than that of the many without, or a network short of training
says zero everywhere.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.detectors.networks.declaration import Target
from mpgrasp.detectors.networks.registry import declaration
from mpgrasp.training.dataset import Batch
from mpgrasp.training.trainer_config import LossConfig, TrainConfig

PARTS = ("loss", "pos", "cos", "sin", "width")
"""The whole and its parts, as `grasp_loss` names them."""


def to_tensors(batch: Batch, width_px: float) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Return image, quality, angle, width and valid of a batch; widths in units of `width_px`."""
    return (
        torch.from_numpy(batch.image),
        torch.from_numpy(batch.quality),
        torch.from_numpy(batch.angle),
        torch.from_numpy(batch.width / np.float32(width_px)),
        torch.from_numpy(batch.valid),
    )


def grasp_loss(
    heads: tuple[Tensor, Tensor, Tensor, Tensor],
    quality: Tensor,
    angle: Tensor,
    width: Tensor,
    valid: Tensor,
    config: LossConfig,
) -> dict[str, Tensor]:
    """Return losses by part, and their weighted sum as "loss".

    Args:
        heads: pos, cos, sin and width, each (n, 1, H, W).
        quality: (n, H, W) in [0, 1].
        angle: (n, H, W) [rad].
        width: (n, H, W) in units of the width head.
        valid: (n, H, W) bool; nothing else is looked at.
        config: weights.
    """
    pos, cos, sin, opening = (h[:, 0] for h in heads)
    seen = valid.float()
    positive = (quality > 0).float() * seen
    # per labelled pixel, or thin objects would hardly count beside large ones; bounded for empty batches
    count = positive.sum().clamp(min=1e-3 * quality.numel())
    # everything but the heads is constant: one product each to differentiate
    weight = seen * (1 + config.positive * quality) / count
    masked = (positive + config.background * (seen - positive)) / count
    doubled = 2 * angle
    parts = {
        "pos": _total(pos, quality, weight, config),
        "cos": _total(cos, torch.cos(doubled) * positive, masked, config),
        "sin": _total(sin, torch.sin(doubled) * positive, masked, config),
        "width": _total(opening, width * positive, masked, config),
    }
    total = (
        config.quality_weight * parts["pos"]
        + parts["cos"]
        + parts["sin"]
        + config.width_weight * parts["width"]
    )
    return {"loss": total, **parts}


def batch_loss(
    network: nn.Module, image: Tensor, target: Target, config: TrainConfig, step: int
) -> dict[str, Tensor]:
    """Return losses by part of a network for a batch, the network computed in the training's precision.

    A network that declares a loss of its own has all of it as "pos", and nothing of the other parts. What it
    draws at random, features to drop or windows to cut, follows from the training's seed and the step.

    Args:
        network: in training mode.
        image: (n, channels, H, W).
        target: its labels.
        config: settings of the training.
        step: number of the step.
    """
    own, device = declaration(config.name).loss, image.device.type
    low = torch.autocast(device, torch.bfloat16, enabled=config.precision == "bfloat16")
    seed = int(np.random.SeedSequence([config.seed, step]).generate_state(1)[0])
    if own is None:
        own_devices = [] if image.device.type == "cpu" else [image.device]
        with torch.random.fork_rng(devices=own_devices), low:
            torch.manual_seed(seed)
            heads = network(image)
        return grasp_loss(heads, *target, config.loss)
    with low:
        loss = own(network, image, target, torch.Generator(image.device).manual_seed(seed))
    nothing = torch.zeros_like(loss)
    return {"loss": loss, "pos": loss, "cos": nothing, "sin": nothing, "width": nothing}


def _total(prediction: Tensor, target: Tensor, weight: Tensor, config: LossConfig) -> Tensor:
    return (F.smooth_l1_loss(prediction, target, reduction="none", beta=config.beta) * weight).sum()
