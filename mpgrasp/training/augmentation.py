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

    def __post_init__(self) -> None:
        if not 0 < self.zoom[0] <= self.zoom[1] or not 0 <= self.warp_probability <= 1:
            raise ConfigError("unusable augmentation", got=self, allowed="0 < zoom, probability in [0, 1]")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """One image with dense labels, all (H, W)."""

    depth: NDArray[np.float32]
    """[m], holes filled."""
    quality: NDArray[np.float32]
    """[0, 1]"""
    angle: NDArray[np.float32]
    """[rad]"""
    width: NDArray[np.float32]
    """[px]"""
    valid: NDArray[np.bool_]
    """False where a turned image has no data."""


def augment(sample: Sample, config: Augmentation, rng: np.random.Generator) -> Sample:
    """The sample flipped, turned, zoomed and moved in depth at random; angles and widths go along."""
    flip, quarters = bool(rng.integers(2)), int(rng.integers(4))
    offset = np.float32(rng.uniform(-config.offset, config.offset))

    def moved(image: NDArray[Any]) -> NDArray[Any]:
        return np.rot90(image[:, ::-1] if flip else image, quarters)

    # both np.rot90 and image angles are counter-clockwise on screen
    turned = Sample(
        depth=moved(sample.depth) + offset,
        quality=moved(sample.quality),
        angle=moved(sample.angle) * np.float32(-1 if flip else 1) + np.float32(quarters * np.pi / 2),
        width=moved(sample.width),
        valid=moved(sample.valid),
    )
    turn = rng.uniform(-config.rotation, config.rotation)
    zoom = float(np.exp(rng.uniform(*np.log(config.zoom))))
    return warp(turned, turn, zoom) if rng.uniform() < config.warp_probability else turned


def warp(sample: Sample, turn: float, zoom: float) -> Sample:
    """The sample turned by `turn` [rad], counter-clockwise on screen, and magnified about its centre."""
    rows, cols = sample.depth.shape
    matrix = cv2.getRotationMatrix2D(((cols - 1) / 2, (rows - 1) / 2), np.rad2deg(turn), zoom)
    # nearest pixels: anything else would mix depths across edges and angles across the wrap
    stacked = np.dstack([sample.depth, sample.quality, sample.angle, sample.width])
    moved = cv2.warpAffine(
        stacked, matrix, (cols, rows), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REFLECT
    )
    valid = cv2.warpAffine(sample.valid.astype(np.uint8), matrix, (cols, rows), flags=cv2.INTER_NEAREST)
    depth, quality, angle, width = np.moveaxis(moved, -1, 0)
    middle = np.float32(np.median(sample.depth[::4, ::4]))
    return Sample(
        # a nearer camera sees the scene larger and every height as it was
        depth=depth + middle * np.float32(1 / zoom - 1),
        quality=quality,
        angle=angle + np.float32(turn),
        width=width * np.float32(zoom),
        valid=valid > 0,
    )
