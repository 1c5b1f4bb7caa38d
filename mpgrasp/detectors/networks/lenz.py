"""Lenz, Lee and Saxena: a small network looks at all rectangles, a large one at the best of them.

Lenz, Lee and Saxena: Deep Learning for Detecting Robotic Grasps (IJRR 2015, https://arxiv.org/abs/1301.3592):
a candidate is an oriented rectangle, whose content is turned upright and resized. A network of two layers of
50 units judges all candidates, one of two layers of 200 the best 100 of those. Their inputs are depth and
surface normals, and colour as YUV where there is any. Departures: hidden units are rectified and trained at
once, where the authors pre-train sigmoid units as sparse auto-encoders; rectangles are twice as long as wide
throughout, so that none has to be padded; they lie on a grid over the whole image, because a cluttered table
has no background image to subtract.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.detectors.networks.declaration import MAX_CHANNELS, NetworkDeclaration, Target
from mpgrasp.detectors.networks.windows import Windows, drawn_pixels
from mpgrasp.exceptions import ConfigError

ANGLES = 12
"""Closing directions of candidates, 15 degrees apart."""
OPENINGS = (18, 25, 35, 49, 69)
"""Openings of candidates [px]; their jaws are half as wide."""
LONG, SHORT = 24, 12
"""Points along and across the closing direction that a rectangle is read at; the authors read 24 by 24."""
BEST = 100
"""Candidates that the large network looks at."""
DRAWN = 32
"""Labelled pixels, and as many of all pixels, that a step learns from in each image."""
FITS = (0.75, 1.5)
"""An opening holds what is labelled with it within these multiples of the label's."""
SLOPE = 30.0
"""Slope of a surface that rises by one unit of the input within a pixel, at 20 units a metre."""
YUV = ((0.299, 0.587, 0.114), (-0.147, -0.289, 0.436), (0.615, -0.515, -0.100))
"""From red, green and blue, after ITU-R BT.601."""
_KINDS = ANGLES * len(OPENINGS)


@dataclass(frozen=True, kw_only=True)
class LenzConfig:
    """Sizes; the units of the two networks are as many as the authors'."""

    channels: int = 1
    """Input channels: 1 depth, 3 colour, 4 both."""
    size: int = NETWORK_SIZE
    """Side of the input image [px]."""
    stride: int = 8
    """Distance between the centres of candidates [px]."""
    small: int = 50
    """Units of each layer of the small network."""
    large: int = 200
    """Units of each layer of the large one."""

    def __post_init__(self) -> None:
        units = self.small, self.large
        if self.channels not in (1, 3, 4) or not 1 <= min(units) <= max(units) <= MAX_CHANNELS:
            raise ConfigError(
                "unusable sizes of a cascade",
                got=self,
                allowed=f"1, 3 or 4 channels, 1 to {MAX_CHANNELS} units",
            )
        if self.stride < 1 or self.size % self.stride or (self.size // self.stride) ** 2 * _KINDS < BEST:
            raise ConfigError("unusable stride of a cascade", got=self, allowed="one that divides the image")


class Judge(nn.Module):
    """Two hidden layers: content of a rectangle, whitened -> log odds that it is a grasp."""

    def __init__(self, inputs: int, units: int) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(inputs, units), nn.Linear(units, units)
        self.last = nn.Linear(units, 1)

    def forward(self, content: Tensor) -> Tensor:
        return self.after_first(self.first(content))

    def after_first(self, hidden: Tensor) -> Tensor:
        """Return log odds (...) for what the first layer makes of contents, (..., units)."""
        odds: Tensor = self.last(F.relu(self.second(F.relu(hidden))))[..., 0]
        return odds.float()


class Lenz(nn.Module):
    """(n, channels, size, size) -> pos, cos, sin and width, each (n, 1, size, size)."""

    answers: Tensor
    directions: Tensor
    slopes: Tensor
    yuv: Tensor

    def __init__(self, config: LenzConfig | None = None) -> None:
        super().__init__()
        self.config = c = config or LenzConfig()
        self._depth = c.channels != 3
        self._planes = 4 * self._depth + 3 * (c.channels >= 3)
        self.windows = Windows(c.size, c.stride, rectangle_offsets())
        inputs = self._planes * self.windows.points
        self.whiten = nn.BatchNorm1d(inputs, affine=False)
        self.small, self.large = Judge(inputs, c.small), Judge(inputs, c.large)
        angle, opening = kinds()
        doubled = 2 * angle
        answers = np.stack([np.cos(doubled), np.sin(doubled), opening / (c.size / 2)])
        directions = np.stack([np.cos(angle), np.sin(angle)])
        across = np.outer([1, 2, 3, 2, 1], [-1, -2, 0, 2, 1]) / 90  # a smoothed derivative along columns
        for name, value in (
            ("answers", answers), ("directions", directions), ("yuv", np.array(YUV)),
            ("slopes", np.stack([across, across.T])[:, None] * SLOPE),
        ):  # fmt: skip
            self.register_buffer(name, torch.tensor(value, dtype=torch.float32), persistent=False)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        answers = [self._of_one(image) for image in torch.split(x, 1)]  # each takes 80 MB
        pos, cos, sin, width = (torch.cat(maps) for maps in zip(*answers, strict=True))
        return pos, cos, sin, width

    def _of_one(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        padded = self.windows.padded(self._seen(image))
        squares = self.windows.squares(padded)
        count, places = len(OPENINGS), self.windows.side**2
        small = []
        for k in range(0, _KINDS, count):
            windows = self.windows.at_places(squares, slice(k, k + count))
            weight, bias = self._for_windows(self.small.first, k)
            hidden = sum(weight[:, p] @ windows[:, p] for p in range(self._planes)) + bias[:, None]
            small.append(self.small.after_first(hidden.transpose(2, 3)))
        chosen = torch.cat(small, dim=1).flatten(1).topk(BEST).indices
        kind = torch.div(chosen, places, rounding_mode="floor")
        place = chosen - kind * places
        content = self._content(self.windows.at(padded, self.windows.places[place], kind), kind)
        sure = torch.sigmoid(self._judged(self.large, content))
        there = (place[..., None] == torch.arange(places, device=place.device)).float()
        quality, best = (sure[..., None] * there).max(dim=1)
        answers = self.answers[:, kind.gather(1, best)].movedim(0, 1)
        return self.windows.spread(quality, answers * (quality > 0).float()[:, None])

    def _seen(self, x: Tensor) -> Tensor:
        """Return the planes (n, planes, H, W): depth, the normal's three parts, and Y, U, V."""
        planes = []
        if self._depth:
            depth = x[:, :1].float()
            slope = F.conv2d(F.pad(depth, [2] * 4, mode="replicate"), self.slopes.to(depth.dtype))
            upright = torch.rsqrt(1 + slope.square().sum(dim=1, keepdim=True))
            planes += [depth, -slope * upright, upright]
        if self.config.channels >= 3:
            planes.append(torch.einsum("yc,nchw->nyhw", self.yuv, x[:, -3:].float()))
        return torch.cat(planes, dim=1)

    def _content(self, windows: Tensor, kind: Tensor) -> Tensor:
        """Return what windows (n, planes, k, points) hold, upright, not whitened: (n, k, planes x points)."""
        if self._depth:
            depth = windows[:, :1] - windows[:, :1].mean(dim=3, keepdim=True)
            u, v = windows[:, 1:2], windows[:, 2:3]
            cos, sin = (self.directions[part][kind][:, None, :, None] for part in (0, 1))
            windows = torch.cat([depth, u * cos - v * sin, u * sin + v * cos, windows[:, 3:]], dim=1)
        return windows.transpose(1, 2).flatten(2)

    def _judged(self, judge: Judge, content: Tensor) -> Tensor:
        whitened = self.whiten(content.flatten(0, 1)).reshape(content.shape)
        odds: Tensor = judge(whitened)
        return odds

    def _for_windows(self, first: nn.Linear, kind: int) -> tuple[Tensor, Tensor]:
        """Return weights (units, planes, points) and bias of a first layer for windows as they are.

        Turning normals, taking the mean from depth and whitening are linear: they are done to the weights.
        """
        mean, var, eps = self.whiten.running_mean, self.whiten.running_var, self.whiten.eps
        assert mean is not None
        assert var is not None
        scaled = first.weight * torch.rsqrt(var + eps)
        bias = first.bias - scaled @ mean
        weight = scaled.reshape(-1, self._planes, self.windows.points)
        if not self._depth:
            return weight, bias
        depth = weight[:, :1] - weight[:, :1].mean(dim=2, keepdim=True)
        along, across = weight[:, 1:2], weight[:, 2:3]
        cos, sin = self.directions[0, kind], self.directions[1, kind]
        turned = [depth, along * cos + across * sin, across * cos - along * sin, weight[:, 3:]]
        return torch.cat(turned, dim=1), bias

    def loss(self, image: Tensor, target: Target, generator: torch.Generator) -> Tensor:
        """Return the cross-entropies of both networks on drawn rectangles.

        A third of them are labelled grasps, a third lie there too and are turned and sized at random, and a
        third are random throughout. A rectangle holds as well as its pixel's label says if its direction
        is within 15 degrees and its opening `FITS`.
        """
        pixels = drawn_pixels(target.quality, target.valid, DRAWN, generator)
        pixels = torch.cat([pixels[:, :DRAWN], pixels], dim=1)
        labels = (target.quality, target.angle, target.width)
        quality, angle, width = (label.flatten(1).gather(1, pixels)[..., None] for label in labels)
        twice = torch.stack([torch.cos(2 * angle), torch.sin(2 * angle)])
        alike = (self.answers[:2, None, None] * twice).sum(dim=0)
        ratio = self.answers[2] / width.clamp(min=1e-3)
        nearest = (alike - ratio.log().abs()).argmax(dim=2)
        drawn = torch.randint(_KINDS, pixels.shape, generator=generator, device=pixels.device)
        labelled = torch.arange(pixels.shape[1], device=pixels.device) < DRAWN
        kind = torch.where(labelled, nearest, drawn)
        fits = (alike >= np.cos(np.pi / 6)) & (ratio >= FITS[0]) & (ratio <= FITS[1])
        holds = quality[..., 0] * fits.gather(2, kind[..., None])[..., 0]
        padded = self.windows.padded(self._seen(image))
        windows = self.windows.at(padded, self.windows.padded_pixels(pixels), kind)
        content = self._content(windows, kind)
        whitened = self.whiten(content.flatten(0, 1)).reshape(content.shape)
        small, large = (
            F.binary_cross_entropy_with_logits(judge(whitened), holds) for judge in (self.small, self.large)
        )
        return small + large


def kinds() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return closing direction [rad] and opening [px] of every kind of candidate, direction by direction."""
    angle = -np.pi / 2 + np.arange(ANGLES) * np.pi / ANGLES
    return np.repeat(angle, len(OPENINGS)), np.tile(np.array(OPENINGS, float), ANGLES)


def rectangle_offsets() -> NDArray[np.intp]:
    """Return where every kind of candidate is read, (kinds, points, 2), rows and columns [px]."""
    angle, opening = kinds()
    along, across = np.meshgrid(
        (np.arange(LONG) + 0.5) / LONG - 0.5, (np.arange(SHORT) + 0.5) / SHORT / 2 - 0.25
    )
    along, across = (np.outer(opening, part.ravel()) for part in (along, across))
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    rows, columns = across * cos - along * sin, along * cos + across * sin
    return np.rint(np.stack([rows, columns], axis=-1)).astype(np.intp)


DECLARATIONS = {
    "lenz": NetworkDeclaration(
        network=Lenz,
        config=LenzConfig,
        source="[Lenz et al.](https://arxiv.org/abs/1301.3592)",
        multiple_of=8,
        variants={"shipped": {}},
        loss=Lenz.loss,
    ),
}
