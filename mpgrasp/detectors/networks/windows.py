"""Windows of an image around pixels, for the networks from before one pass over the image told every pixel.

Such a network judges one window at a time. It is asked at places on a grid, and what it says there is spread
over the image: the quality bilinearly, so that its peaks stay at the places, and all else from the nearest.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F


class Windows(nn.Module):
    """Pixels of windows, by index: nothing is interpolated, and the image is continued beyond its border.

    Args:
        size: side of the image [px].
        stride: distance between places, which divides the side [px].
        offsets: (kinds, points, 2) rows and columns of a window's points from its place [px].
    """

    places: Tensor
    offsets: Tensor
    within: Tensor

    def __init__(self, size: int, stride: int, offsets: NDArray[np.intp]) -> None:
        super().__init__()
        self.size, self.stride = size, stride
        self.points = offsets.shape[1]
        self.side = size // stride
        self.reach = int(max(offsets.max() + 1, -offsets.min()))
        self._row = size + 2 * self.reach
        centres = np.arange(self.side) * stride + stride // 2
        rows, columns = np.meshgrid(centres, centres, indexing="ij")
        for name, value in (
            ("places", (rows + self.reach) * self._row + columns + self.reach),  # in padded images
            ("offsets", offsets[..., 0] * self._row + offsets[..., 1]),  # likewise
            ("within", (offsets[..., 0] + self.reach) * 2 * self.reach + offsets[..., 1] + self.reach),
        ):  # the last: in the square around a place that holds all windows
            flat = np.asarray(value, np.int64).reshape(-1 if name == "places" else offsets.shape[:2])
            self.register_buffer(name, torch.from_numpy(flat), persistent=False)

    def padded(self, image: Tensor) -> Tensor:
        """Return an image (n, c, size, size) with its border continued, (n, c, larger, larger)."""
        return F.pad(image, [self.reach] * 4, mode="replicate")

    def squares(self, padded: Tensor) -> Tensor:
        """Return the squares around all places that hold their windows, (n, c, pixels, places)."""
        first, long = self.stride // 2, (self.side - 1) * self.stride + 2 * self.reach
        inner = padded[:, :, first : first + long, first : first + long]
        columns = F.unfold(inner, 2 * self.reach, stride=self.stride)
        return columns.reshape(-1, padded.shape[1], 4 * self.reach**2, self.side**2)

    def at_places(self, squares: Tensor, kinds: slice) -> Tensor:
        """Return the windows of some kinds at all places, (n, c, kinds, points, places)."""
        index = self.within[kinds]
        found = squares.index_select(2, index.flatten())
        return found.reshape(-1, squares.shape[1], *index.shape, self.side**2)

    def at(self, padded: Tensor, centres: Tensor, kinds: Tensor) -> Tensor:
        """Return the windows of these kinds around these padded pixels, both (n, k), as (n, c, k, points)."""
        index = (centres[..., None] + self.offsets[kinds]).flatten(1)
        channels = padded.shape[1]
        found = padded.flatten(2).gather(2, index[:, None].expand(-1, channels, -1))
        return found.reshape(-1, channels, centres.shape[1], self.points)

    def padded_pixels(self, pixels: Tensor) -> Tensor:
        """Return the places in padded images of pixels of an image, both counted along its rows."""
        rows, columns = pixels // self.size, pixels % self.size
        return (rows + self.reach) * self._row + columns + self.reach

    def spread(self, quality: Tensor, others: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return pos, cos, sin and width, each (n, 1, size, size), of values at the places.

        Args:
            quality: (n, places).
            others: (n, 3, places), cosine, sine and width.
        """
        shape, whole = (self.side, self.side), (self.size, self.size)
        coarse = quality.float().reshape(-1, 1, *shape)
        pos = F.interpolate(coarse, size=whole, mode="bilinear", align_corners=False)
        near = F.interpolate(others.float().reshape(-1, 3, *shape), size=whole, mode="nearest")
        cos, sin, width = torch.split(near, 1, dim=1)
        return pos, cos, sin, width


def drawn_pixels(quality: Tensor, valid: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Return pixels (n, 2 count) to learn from: half of them labelled, where an image has any, half of all.

    Args:
        quality: (n, H, W) labels in [0, 1].
        valid: (n, H, W) bool; other pixels are never drawn.
        count: number of either half.
        generator: on the device of the labels.
    """
    seen = valid.flatten(1).float() + 1e-12  # an image without any valid pixel still gives some
    labelled = (quality.flatten(1) > 0).float() * seen
    labelled = torch.where(labelled.sum(dim=1, keepdim=True) >= 1, labelled, seen)
    halves = [torch.multinomial(w, count, replacement=True, generator=generator) for w in (labelled, seen)]
    return torch.cat(halves, dim=1)
