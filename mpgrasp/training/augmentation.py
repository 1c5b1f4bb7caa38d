"""Random changes to training images, with dense labels that change to match."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError


@dataclass(frozen=True, kw_only=True)
class Augmentation:
    """Random changes to training images, with the labels changed to match."""

    rotation: float = np.pi / 4
    """Largest turn beside flips and quarter turns [rad]."""
    zoom: tuple[float, float] = (0.85, 1.25)
    """Magnification: the camera comes nearer or goes farther, heights stay as they are."""
    warp_probability: float = 0.5
    """Share of images that are turned and zoomed at all; flips and quarter turns are free of loss."""
    offset: float = 0.01
    """Largest shift of all depths [m]."""
    brightness: float = 0.3
    """Colour alone: largest change of the logarithm of all intensities."""
    contrast: float = 0.3
    """Colour alone: largest change of the logarithm of the spread about the mean intensity."""
    cast: float = 0.1
    """Colour alone: largest change of the logarithm of red, green and blue, each on its own."""

    def __post_init__(self) -> None:
        if not 0 < self.zoom[0] <= self.zoom[1] or not 0 <= self.warp_probability <= 1:
            raise ConfigError("unusable augmentation", got=self, allowed="0 < zoom, probability in [0, 1]")
        if min(self.rotation, self.offset, self.brightness, self.contrast, self.cast) < 0:
            raise ConfigError("unusable augmentation", got=self, allowed="ranges from 0")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """One image with dense labels, all (H, W)."""

    depth: NDArray[np.float32]
    """Depth, holes filled [m]."""
    quality: NDArray[np.float32]
    """Label: worth of the grasp, in [0, 1]."""
    angle: NDArray[np.float32]
    """Label: closing direction in the image [rad]."""
    width: NDArray[np.float32]
    """Label: opening [px]."""
    valid: NDArray[np.bool_]
    """False where a turned image has no data."""
    rgb: NDArray[np.uint8] | None = None
    """(H, W, 3), where colour was asked for."""

    def resized(self, size: int) -> Sample:
        """Return the sample at `size` px: a pixel takes the old one under its centre, widths are scaled."""
        rows, cols = self.depth.shape
        if rows == cols == size:
            return self
        at = np.ix_(*(((np.arange(size) + 0.5) * old / size).astype(np.intp) for old in (rows, cols)))
        return Sample(
            depth=self.depth[at],
            quality=self.quality[at],
            angle=self.angle[at],
            width=self.width[at] * np.float32(size / cols),
            valid=self.valid[at],
            rgb=None if self.rgb is None else self.rgb[at],
        )


def augment(sample: Sample, config: Augmentation, rng: np.random.Generator) -> Sample:
    """Flip, turn, zoom, move in depth and recolour the sample at random; labels go along.

    The same draws are made with and without colour, so that modalities are trained on the same images.
    """
    flip, quarters = bool(rng.integers(2)), int(rng.integers(4))
    offset = np.float32(rng.uniform(-config.offset, config.offset))
    light = rng.uniform(-1, 1, 5)

    def moved(image: NDArray[Any]) -> NDArray[Any]:
        return np.ascontiguousarray(np.rot90(image[:, ::-1] if flip else image, quarters))

    # both np.rot90 and image angles are counter-clockwise on screen
    turned = Sample(
        depth=moved(sample.depth) + offset,
        quality=moved(sample.quality),
        angle=moved(sample.angle) * np.float32(-1 if flip else 1) + np.float32(quarters * np.pi / 2),
        width=moved(sample.width),
        valid=moved(sample.valid),
        rgb=None if sample.rgb is None else moved(_recoloured(sample.rgb, config, light)),
    )
    turn = rng.uniform(-config.rotation, config.rotation)
    zoom = float(np.exp(rng.uniform(*np.log(config.zoom))))
    return warp(turned, turn, zoom) if rng.uniform() < config.warp_probability else turned


def _recoloured(
    rgb: NDArray[np.uint8], config: Augmentation, light: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Return colours (H, W, 3) of other contrast, brightness and cast, by `light` (5,) in [-1, 1]."""
    mean = float(rgb.mean())
    gain = np.exp(config.brightness * light[0] + config.cast * light[2:])  # (3,)
    spread = np.exp(config.contrast * light[1])
    levels = (np.arange(256)[:, None] - mean) * spread + mean
    table = np.clip(np.rint(levels * gain), 0, 255).astype(np.uint8)  # (256, 3)
    return np.asarray(cv2.LUT(rgb, table[None]), np.uint8)


def warp(sample: Sample, turn: float, zoom: float) -> Sample:
    """Return the sample turned by `turn` [rad], counter-clockwise on screen, and magnified."""
    rows, cols = sample.depth.shape
    matrix = cv2.getRotationMatrix2D(((cols - 1) / 2, (rows - 1) / 2), np.rad2deg(turn), zoom)

    def moved(image: NDArray[Any], border: int = cv2.BORDER_REFLECT) -> NDArray[Any]:
        # nearest pixels: anything else would mix depths across edges and angles across the wrap
        return cv2.warpAffine(
            np.ascontiguousarray(image), matrix, (cols, rows), flags=cv2.INTER_NEAREST, borderMode=border
        )

    middle = np.float32(np.median(sample.depth[::4, ::4]))
    return Sample(
        # a nearer camera sees the scene larger and every height as it was
        depth=moved(sample.depth) + middle * np.float32(1 / zoom - 1),
        quality=moved(sample.quality),
        angle=moved(sample.angle) + np.float32(turn),
        width=moved(sample.width) * np.float32(zoom),
        valid=moved(sample.valid.view(np.uint8), cv2.BORDER_CONSTANT) > 0,
        rgb=None if sample.rgb is None else moved(sample.rgb),
    )
