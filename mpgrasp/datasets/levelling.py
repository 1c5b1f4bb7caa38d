"""A table seen aslant, levelled: what rises over it stays, as if the camera had looked straight down.

Networks of this project saw cameras that look down, and depth along the optical axis. Cornell's camera looks
aslant, and its published depth is the distance from the camera, which bends a flat table. A quadratic surface
through the table takes both out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpgrasp.datasets.labelled_image import LabelledImage

ROUNDS = 12
"""Fits, each without what the one before left out."""
KEPT = 1.5
"""Pixels farther from the surface than this many medians of the distance are no table."""
STEP = 4
"""Every so many pixels along rows and columns are fitted."""
LEAST = 100
"""Fewest pixels that a table is made of."""


def level(image: LabelledImage) -> LabelledImage:
    """Return an image whose table lies at its median depth; an image with hardly any depth stays as it is."""
    table = table_depth(image.depth)
    if table is None:
        return image
    middle = np.float32(np.nanmedian(image.depth))
    return replace(image, depth=np.asarray(image.depth - table + middle, np.float32))


def table_depth(depth: NDArray[np.float32]) -> NDArray[np.float32] | None:
    """Return the depth (H, W) [m] of the table alone: a quadratic surface through most of an image.

    Args:
        depth: (H, W) [m], NaN = no return.

    Returns:
        The surface, or None where fewer than `LEAST` of the pixels that are fitted have a depth.
    """
    height, width = depth.shape
    v, u = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)  # (H, W, 6)
    some = depth[::STEP, ::STEP]
    known = np.isfinite(some)
    if known.sum() < LEAST:
        return None
    x, y = terms[::STEP, ::STEP][known], some[known].astype(float)
    kept = np.ones(len(y), bool)
    for _ in range(ROUNDS):
        weights = np.linalg.lstsq(x[kept], y[kept], rcond=None)[0]
        off = np.abs(x @ weights - y)
        bound = KEPT * max(float(np.median(off)), 1e-4)
        kept = off <= bound
        if kept.sum() < LEAST:
            return None
    return np.asarray(terms @ weights, np.float32)
