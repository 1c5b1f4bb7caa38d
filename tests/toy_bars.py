"""Images of one bar, upright or lying, for networks with a loss of their own to learn from in seconds."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from mpgrasp.detectors.networks.declaration import Target
from mpgrasp.detectors.networks.registry import declaration

SIZE = 64
"""Side of the images [px]."""


def bars(
    count: int, half: tuple[int, int], share: int, width_px: float, dice: torch.Generator
) -> tuple[Tensor, Target]:
    """Return images (count, 1, SIZE, SIZE) of a bar that stands out, and their labels.

    Args:
        count: number of images.
        half: half of the short and of the long side of a bar [px].
        share: the bar's sides over those of the part in its middle that is labelled.
        width_px: opening of the labels [px].
        dice: decides where it lies, and which way.
    """
    image = torch.zeros(count, 1, SIZE, SIZE)
    quality, angle, width = (torch.zeros(count, SIZE, SIZE) for _ in range(3))
    for n in range(count):
        row, column = torch.randint(20, SIZE - 20, (2,), generator=dice).tolist()
        lying = bool(torch.randint(2, (1,), generator=dice))
        tall, long = half if lying else half[::-1]
        image[n, 0, row - tall : row + tall, column - long : column + long] = -0.4
        tall, long = tall // share, long // share
        middle = (n, slice(row - tall, row + tall), slice(column - long, column + long))
        quality[middle] = 1
        angle[middle] = -math.pi / 2 if lying else 0.0
        width[middle] = width_px / (SIZE / 2)
    return image, Target(quality, angle, width, torch.ones(count, SIZE, SIZE, dtype=torch.bool))


def share_right_after_training(
    name: str, network: nn.Module, steps: int, rate: float, half: tuple[int, int], share: int, width_px: float
) -> float:
    """Return the share of 20 new bars whose best pixel is labelled and whose direction is right there."""
    own = declaration(name).loss
    assert own is not None
    dice = torch.Generator().manual_seed(0)
    optimiser = torch.optim.Adam(network.parameters(), rate)
    for _ in range(steps):
        optimiser.zero_grad()
        loss = own(network, *bars(8, half, share, width_px, dice), dice)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    image, target = bars(20, half, share, width_px, dice)
    with torch.inference_mode():
        pos, cos, _, _ = network.eval()(image)
    best = pos.flatten(1).argmax(dim=1, keepdim=True)
    labelled = target.quality.flatten(1).gather(1, best) > 0
    doubled = torch.cos(2 * target.angle.flatten(1).gather(1, best))
    aligned = cos.flatten(1).gather(1, best) * doubled > 0.5
    return float((labelled & aligned).float().mean())
