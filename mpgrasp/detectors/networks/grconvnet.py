"""GR-ConvNet as published, so that its state dicts load unchanged.

Kumra, Joshi and Sahin: Antipodal Robotic Grasping using Generative Residual Convolutional Neural Network
(IROS 2020); https://github.com/skumra/robotic-grasping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.detectors.networks.declaration import HEADS, MAX_CHANNELS, NetworkDeclaration, PublishedWeights
from mpgrasp.detectors.networks.transposed import PhasedTranspose
from mpgrasp.exceptions import ConfigError


@dataclass(frozen=True, kw_only=True)
class GRConvNetConfig:
    """Settings; their defaults are as published."""

    channels: int = 1
    """Input channels."""
    features: int = 32
    """Channels of the first layer; others have twice and four times as many."""
    dropout: float = 0.1
    """Share of the features that each head drops in training."""

    def __post_init__(self) -> None:
        if not (1 <= self.channels <= MAX_CHANNELS and 1 <= self.features <= MAX_CHANNELS):
            raise ConfigError(
                "unusable GR-ConvNet settings", got=self, allowed=f"1 to {MAX_CHANNELS} channels and features"
            )
        if not 0 <= self.dropout < 1:
            raise ConfigError("unusable dropout of GR-ConvNet", got=self.dropout, allowed="0 to below 1")


class ResidualBlock(nn.Module):
    """Two convolutions, the input added: (n, c, H, W) -> (n, c, H, W)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels, channels, 3, padding=1)
        self.bn1 = nn.BatchNorm2d(channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, padding=1)
        self.bn2 = nn.BatchNorm2d(channels)

    def forward(self, x: Tensor) -> Tensor:
        inner: Tensor = self.bn2(self.conv2(F.relu(self.bn1(self.conv1(x)))))
        return x + inner


def dropped(x: Tensor, share: float) -> Tensor:
    """Return x with about that share of its values set to 0 and the others scaled up to the same mean.

    As `torch.nn.functional.dropout`, whose draws on a CPU take longer than all of the heads; the share is
    rounded to a multiple of 2**-16. What is drawn follows from PyTorch's generator.
    """
    if x.device.type != "cpu":
        return F.dropout(x, share)
    seed = int(torch.randint(2**62, (), dtype=torch.int64))
    draws = np.random.Generator(np.random.SFC64(seed)).integers(0, 2**16, x.numel(), dtype=np.uint16)
    kept = torch.from_numpy(draws >= round(share * 2**16)).view(x.permute(0, 2, 3, 1).shape)
    return x * (kept.permute(0, 3, 1, 2).to(x.dtype) / (1 - share))


class GRConvNet(nn.Module):
    """(n, channels, H, W) -> pos, cos, sin and width, each (n, 1, H, W); H and W are multiples of 4."""

    def __init__(self, config: GRConvNetConfig | None = None) -> None:
        super().__init__()
        self.config = config or GRConvNetConfig()
        one = self.config.features
        two, four = 2 * one, 4 * one
        self.conv1, self.bn1 = nn.Conv2d(self.config.channels, one, 9, padding=4), nn.BatchNorm2d(one)
        self.conv2, self.bn2 = nn.Conv2d(one, two, 4, stride=2, padding=1), nn.BatchNorm2d(two)
        self.conv3, self.bn3 = nn.Conv2d(two, four, 4, stride=2, padding=1), nn.BatchNorm2d(four)
        for k in range(1, 6):
            self.add_module(f"res{k}", ResidualBlock(four))
        self.conv4 = PhasedTranspose(four, two, 4, stride=2, padding=1, output_padding=1)
        self.bn4 = nn.BatchNorm2d(two)
        self.conv5 = PhasedTranspose(two, one, 4, stride=2, padding=2, output_padding=1)
        self.bn5 = nn.BatchNorm2d(one)
        self.conv6 = nn.ConvTranspose2d(one, one, 9, padding=4)
        for head in HEADS:  # of 2 x 2, which bring the odd size of the features back to the image's
            self.add_module(f"{head}_output", nn.Conv2d(one, 1, 2))
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
                nn.init.xavier_uniform_(module.weight)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        for k in (1, 2, 3):
            x = F.relu(getattr(self, f"bn{k}")(getattr(self, f"conv{k}")(x)))
        for k in range(1, 6):
            x = getattr(self, f"res{k}")(x)
        for k in (4, 5):
            x = F.relu(getattr(self, f"bn{k}")(getattr(self, f"conv{k}")(x)))
        x = self.conv6(x)
        share = self.config.dropout if self.training else 0.0
        pos, cos, sin, width = (
            getattr(self, f"{head}_output")(dropped(x, share) if share else x).float() for head in HEADS
        )
        return pos, cos, sin, width


DECLARATIONS = {
    "grconvnet": NetworkDeclaration(
        network=GRConvNet,
        config=GRConvNetConfig,
        source="[GR-ConvNet](https://arxiv.org/abs/1909.04810)",
        multiple_of=4,
        published=PublishedWeights(
            entry="res5.bn2.weight",
            width_px=150.0,
            sizes={"channels": ("conv1.weight", 1), "features": ("conv1.weight", 0)},
            card={
                "data": "Cornell or Jacquard",
                "source": "https://github.com/skumra/robotic-grasping",
                "licence": "BSD-3-Clause",
            },
        ),
    ),
}
