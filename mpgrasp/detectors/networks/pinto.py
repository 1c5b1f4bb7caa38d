"""Pinto and Gupta: a patch and its 18 angles.

Pinto and Gupta: Supersizing Self-supervision (ICRA 2016, https://arxiv.org/abs/1509.06825): AlexNet looks at
a patch of one and a half times the gripper and says of each of 18 closing directions, 10 degrees apart,
whether a grasp at the patch's centre holds. The hand always opens fully, so the network claims no opening. It
learnt from 50,000 grasps of a robot; here it learns from the common training images. Departures: AlexNet is
reduced to patches of an image of 224 px (the authors' sizes are the variant "authors"), its first weights are
random and not ImageNet's, it has batch norm for the local response norm, and patches lie on a grid, not at
random.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.detectors.networks.declaration import MAX_CHANNELS, NetworkDeclaration, Target
from mpgrasp.detectors.networks.grasp_network import conv_bn
from mpgrasp.detectors.networks.windows import Windows, drawn_pixels
from mpgrasp.exceptions import ConfigError

ANGLES = 18
"""Closing directions."""
OPEN = 1.0
"""What stands for the width, more than the stroke of the hand from anywhere; a detector claims the stroke."""
DRAWN = 12
"""Labelled pixels, and as many of all pixels, that a step learns from in each image."""
FIRST_KERNEL, FIRST_STRIDE = (7, 11), (2, 4)
"""Of the first convolution of small patches, and of AlexNet's."""
SMALL_SIDE = 128
"""Largest side of a small patch [px]."""


@dataclass(frozen=True, kw_only=True)
class PintoConfig:
    """Sizes."""

    channels: int = 1
    """Input channels."""
    size: int = NETWORK_SIZE
    """Side of the input image [px]."""
    patch: int = 72
    """Side of a patch [px]: one and a half times the hand's opening as it is seen from 0.45 m."""
    side: int = 72
    """Side to which patches are resized [px]."""
    stride: int = 8
    """Distance between patches [px]."""
    widths: tuple[int, ...] = (16, 32, 48, 48, 32)
    """Channels of the five convolutions."""
    hidden: tuple[int, ...] = (256, 128)
    """Units of the two hidden layers behind them."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "widths", tuple(self.widths))
        object.__setattr__(self, "hidden", tuple(self.hidden))
        sizes = (self.channels, *self.widths, *self.hidden)
        if (
            len(self.widths) != 5
            or len(self.hidden) != 2
            or not 1 <= min(sizes) <= max(sizes) <= MAX_CHANNELS
        ):
            raise ConfigError(
                "unusable sizes of a patch network",
                got=self,
                allowed=f"five widths and two hidden layers, all 1 to {MAX_CHANNELS}",
            )
        sides = (self.patch, self.side)
        fits = 32 <= min(sides) <= max(sides) <= 512 and self.patch % 2 == 0
        if not fits or self.stride < 1 or self.size % self.stride:
            raise ConfigError(
                "unusable patches",
                got=self,
                allowed="sides from 32 to 512, that of a patch even, and a stride that divides the image",
            )


class Pinto(nn.Module):
    """(n, channels, size, size) -> pos, cos, sin and width, each (n, 1, size, size)."""

    doubled: Tensor

    def __init__(self, config: PintoConfig | None = None) -> None:
        super().__init__()
        self.config = c = config or PintoConfig()
        large = int(c.side > SMALL_SIDE)
        kernel, stride = FIRST_KERNEL[large], FIRST_STRIDE[large]
        a, b, d, e, f = c.widths
        self.features = nn.Sequential(
            conv_bn(c.channels, a, kernel, stride=stride), nn.MaxPool2d(3, 2),
            conv_bn(a, b, 5), nn.MaxPool2d(3, 2),
            conv_bn(b, d, 3), conv_bn(d, e, 3), conv_bn(e, f, 3), nn.MaxPool2d(3, 2),
        )  # fmt: skip
        side = (c.side - 1) // stride + 1
        for _ in range(3):
            side = (side - 3) // 2 + 1
        self.head = nn.Sequential(
            nn.Linear(f * side**2, c.hidden[0]), nn.ReLU(inplace=True),
            nn.Linear(c.hidden[0], c.hidden[1]), nn.ReLU(inplace=True),
            nn.Linear(c.hidden[1], ANGLES),
        )  # fmt: skip
        span = np.arange(c.patch) - c.patch // 2  # the whole square around a place
        offsets = np.stack(np.meshgrid(span, span, indexing="ij"), axis=-1).reshape(1, -1, 2)
        self.windows = Windows(c.size, c.stride, offsets)
        angles = 2 * bin_angles(torch.arange(ANGLES))
        self.register_buffer("doubled", torch.stack([torch.cos(angles), torch.sin(angles)]), persistent=False)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        windows = self.windows.squares(self.windows.padded(x)).transpose(2, 3)
        scores = torch.sigmoid(self._judge(windows).float())
        quality, best = scores.max(dim=2)
        direction = self.doubled[:, best].movedim(0, 1)
        opening = torch.full_like(quality, OPEN)[:, None]
        return self.windows.spread(quality, torch.cat([direction, opening], dim=1))

    def _judge(self, windows: Tensor) -> Tensor:
        """Return log odds (n, k, ANGLES) of patches (n, c, k, points)."""
        n, channels, k, _ = windows.shape
        patches = windows.transpose(1, 2).reshape(n * k, channels, self.config.patch, self.config.patch)
        patches = patches - patches.mean(dim=(2, 3), keepdim=True)
        if self.config.side != self.config.patch:
            patches = F.interpolate(
                patches, size=(self.config.side,) * 2, mode="bilinear", align_corners=False
            )
        judged: Tensor = self.head(self.features(patches).flatten(1))
        return judged.reshape(n, k, ANGLES)

    def loss(self, image: Tensor, target: Target, generator: torch.Generator) -> Tensor:
        """Return the cross-entropy of patches around drawn pixels.

        A labelled direction and its two neighbours hold as well as the label says; others, and all of a pixel
        without a label, do not.
        """
        pixels = drawn_pixels(target.quality, target.valid, DRAWN, generator)
        everywhere = self.windows.padded_pixels(pixels)
        windows = self.windows.at(self.windows.padded(image), everywhere, torch.zeros_like(pixels))
        quality, angle = (label.flatten(1).gather(1, pixels) for label in (target.quality, target.angle))
        apart = bin_angles(torch.arange(ANGLES, device=angle.device)) - angle[..., None]
        apart = torch.remainder(apart + torch.pi / 2, torch.pi) - torch.pi / 2
        holds = quality[..., None] * (apart.abs() <= 1.5 * torch.pi / ANGLES)
        return F.binary_cross_entropy_with_logits(self._judge(windows).float(), holds)


def bin_angles(bins: Tensor) -> Tensor:
    """Return the closing directions in the middle of bins [rad]."""
    return (bins + 0.5) * (torch.pi / ANGLES) - torch.pi / 2


AUTHORS = {"side": 227, "widths": (96, 256, 384, 384, 256), "hidden": (4096, 1024)}
"""AlexNet's sizes, as the authors had them."""

DECLARATIONS = {
    "pinto": NetworkDeclaration(
        network=Pinto,
        config=PintoConfig,
        source="[Pinto and Gupta](https://arxiv.org/abs/1509.06825)",
        multiple_of=8,
        variants={"shipped": {}, "authors": AUTHORS},
        loss=Pinto.loss,
    ),
}
