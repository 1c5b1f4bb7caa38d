"""Rectangular windows of cells: their sizes, and the greatest height in them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]


def odd(cells: float) -> int:
    """Return the nearest odd whole number, so that a filter has a centre."""
    return max(2 * round((cells - 1) / 2) + 1, 1)


def highest(height: Float32, rows: int, cols: int) -> Float32:
    """Return the greatest height in a window of (rows, cols) around each cell."""
    return np.asarray(cv2.dilate(height, np.ones((rows, cols), np.uint8)))
