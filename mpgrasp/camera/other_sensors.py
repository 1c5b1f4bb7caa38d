"""Errors of cameras of another kind, which no network here was trained on: time of flight, and patterns.

A time-of-flight camera mixes the light of both sides of an edge into a depth between them ("flying pixels"),
and light that comes by way of a neighbouring surface makes hollows look deeper (multipath). A camera that
projects a pattern loses patches in which it cannot make the pattern out. The sizes are assumptions; what
matters is that these errors are of another kind than stereo noise.
"""

from __future__ import annotations

from statistics import NormalDist

import cv2
import numpy as np
from numpy.typing import NDArray

EDGE = 0.004
"""Difference between depths of neighbouring pixels from which there is an edge [m]."""
HOLLOW_PX = 8.0
"""Standard deviation of the Gaussian that tells what a pixel's surroundings are, of multipath [px]."""

Depth = NDArray[np.float32]


def multipath(depth: Depth, gain: float) -> Depth:
    """Return depths (H, W) [m] in which what lies deeper than its surroundings looks deeper yet.

    Args:
        depth: (H, W) true z-depth [m], NaN = no return.
        gain: error over the depth below the surroundings [-].
    """
    known = np.isfinite(depth)
    filled = np.where(known, depth, 0).astype(np.float32)
    sums, weights = (
        cv2.GaussianBlur(image, (0, 0), HOLLOW_PX, borderType=cv2.BORDER_REPLICATE)
        for image in (filled, known.astype(np.float32))
    )
    around = sums / np.maximum(weights, np.float32(1e-6))
    return np.asarray(depth + np.float32(gain) * np.maximum(depth - around, 0), np.float32)


def flying_pixels(depth: Depth, share: float, rng: np.random.Generator) -> Depth:
    """Return depths (H, W) [m] in which pixels at edges lie anywhere between both sides.

    Args:
        depth: (H, W) z-depth [m], NaN = no return.
        share: of the pixels at edges that fly [0, 1].
        rng: source of the noise; it advances alike whatever the image shows.
    """
    chance, place = rng.random(depth.shape, np.float32), rng.random(depth.shape, np.float32)
    kernel = np.ones((3, 3), np.uint8)
    near = cv2.erode(np.where(np.isnan(depth), np.inf, depth).astype(np.float32), kernel)
    far = cv2.dilate(np.where(np.isnan(depth), -np.inf, depth).astype(np.float32), kernel)
    with np.errstate(invalid="ignore"):
        flies = np.isfinite(depth) & (far - near > EDGE) & (chance < share)
        return np.asarray(np.where(flies, near + place * (far - near), depth), np.float32)


def lost_patches(noise: Depth, share: float) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that a frame loses in patches.

    Args:
        noise: (H, W) normal noise of variance 1, correlated over the size of a patch.
        share: of its pixels that are lost, on average (0, 1).
    """
    return np.asarray(noise < NormalDist().inv_cdf(share))
