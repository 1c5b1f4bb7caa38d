"""Maps and depth images as pictures that people can read."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.geometry import FloatArray

Picture = NDArray[np.uint8]
"""A colour picture: RGB, (H, W, 3)."""
HOLE = (60, 60, 60)
"""Colour of what has no value."""

_CYCLIC = cv2.COLORMAP_HSV
_SEQUENTIAL = cv2.COLORMAP_VIRIDIS


def shade(values: FloatArray, low: float | None = None, high: float | None = None) -> Picture:
    """Return the picture (H, W, 3) of a map (H, W), dark at `low` and bright at `high`; NaN is grey.

    Bounds that are None are the map's own.
    """
    finite = np.isfinite(values)
    if low is None:
        low = float(values[finite].min()) if finite.any() else 0.0
    if high is None:
        high = float(values[finite].max()) if finite.any() else 1.0
    scaled = (np.where(finite, values, low) - low) / max(high - low, 1e-9)
    return _colour(scaled, finite, _SEQUENTIAL)


def shade_lines(angle: FloatArray, weight: FloatArray) -> Picture:
    """Return the picture (H, W, 3) of lines at angles [rad]: hue repeats every half turn, weight fades."""
    finite = np.isfinite(angle)
    wheel = _colour(np.mod(np.where(finite, angle, 0) / np.pi, 1.0), finite, _CYCLIC)
    return np.asarray(wheel * np.clip(weight, 0.15, 1.0)[..., None], np.uint8)


def shade_depth(depth: FloatArray) -> Picture:
    """Return the picture (H, W, 3) of a depth image, near bright, stretched to what matters in it."""
    finite = np.isfinite(depth)
    if not finite.any():
        return shade(depth)
    near, far = np.percentile(depth[finite], (0.5, 99.5))
    # at least 3 cm of range, or the noise of an empty table would fill the picture
    near = min(near, far - 0.03)
    return shade(-depth, -far, -near)


def _colour(scaled: FloatArray, finite: NDArray[np.bool_], colour_map: int) -> Picture:
    levels = np.asarray(np.clip(scaled, 0, 1) * 255, np.uint8)
    picture = np.asarray(cv2.applyColorMap(levels, colour_map)[..., ::-1], np.uint8).copy()
    picture[~finite] = HOLE
    return picture
