"""Uncertainty of each cell, information gain of a view from above it, and cost of that view (eq. 10-13)."""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np

from mpgrasp.controllers.grid_map import GridMap
from mpgrasp.geometry import FloatArray

Border = Literal["nothing", "mirror"]
"""Entropy beyond the grid: "nothing" to be learnt (eq. 11 sums over cells), or the grid's mirror image,
as in published multi-view picking code, which takes away the pull towards the middle of the grid."""


def cell_entropy(counts: FloatArray, prior: float = 0.0) -> FloatArray:
    """Entropy (...) [nat] of quality histograms (..., n_q), eq. 10; `prior` is added to every bin.

    An empty histogram is maximally uncertain, log n_q: the limit of a vanishing uniform prior, where
    eq. 10 is 0/0.
    """
    p = np.asarray(counts)
    if prior > 0:
        p = p + p.dtype.type(prior) if np.issubdtype(p.dtype, np.floating) else p + float(prior)
    total = np.einsum("...q->...", p)  # twice as fast as sum where the last axis is short
    # -sum p/S log(p/S) = log S - 1/S sum p log p
    logs = np.log(p, out=np.zeros(p.shape, np.result_type(p, np.float32)), where=True if prior > 0 else p > 0)
    safe = np.where(total > 0, total, 1)
    entropy = np.log(safe) - np.einsum("...q,...q->...", p, logs) / safe
    result: FloatArray = np.where(total > 0, np.maximum(entropy, 0.0), np.log(p.shape[-1]))
    return result


def grid_entropy(grid: GridMap, before: FloatArray | None = None) -> FloatArray:
    """Entropy (ny, nx) [nat] of every cell with `prior_count` per angle and quality bin, hence N_theta of
    it per quality bin; log N_q, the maximum, where nothing was seen.

    Args:
        grid: the map.
        before: what this function gave before the last view; all but that view's cells is taken from there.
    """
    prior = grid.config.prior_count * grid.config.n_angle
    if before is None:
        return cell_entropy(grid.quality_counts, prior)
    entropy = before.copy()
    counts = grid.quality_counts.reshape(-1, grid.config.n_quality)
    entropy.reshape(-1)[grid.touched] = cell_entropy(counts.take(grid.touched, axis=0), prior)
    return entropy


def information_gain(entropy: FloatArray, sigma: float, border: Border = "nothing") -> FloatArray:
    """Expected gain (ny, nx) [nat] of a view from above each cell, eq. 11.

    The weights P are a Gaussian of `sigma` cells, cut at 3 sigma, that sums to one: the gain is the mean
    entropy under the footprint, whatever its size, so that the exploration cost weighs the same at every
    height.
    """
    radius = max(1, int(np.ceil(3 * sigma)))
    offsets = np.arange(-radius, radius + 1)
    kernel = np.exp(-0.5 * (offsets / max(sigma, 1e-9)) ** 2)
    kernel /= kernel.sum()
    image = np.asarray(entropy, np.float32)
    if border == "nothing" or radius < min(image.shape):
        beyond = cv2.BORDER_CONSTANT if border == "nothing" else cv2.BORDER_REFLECT
        gain = cv2.sepFilter2D(image, -1, kernel, kernel, borderType=beyond)
    else:
        # a footprint may be wider than the grid, which OpenCV's own mirroring cannot serve
        padded = np.pad(image, radius, mode="symmetric")
        gain = cv2.sepFilter2D(padded, -1, kernel, kernel)[radius:-radius, radius:-radius]
    return np.asarray(gain, np.float32)


def exploration_cost(grid: GridMap, centre: FloatArray | None, height_fraction: float) -> FloatArray:
    """Cost r (ny, nx) [m] of a viewpoint above each cell, eq. 13.

    The distance to the best cell at world (x, y) `centre`, times one minus the height fraction
    (t_z - z_min) / (z_max - z_min). Zero where there is no best cell yet.
    """
    if centre is None:
        return np.zeros(grid.shape)
    x, y = grid.axes()
    distance = np.sqrt((x - centre[0]) ** 2 + ((y - centre[1]) ** 2)[:, None])  # (ny, nx)
    cost: FloatArray = distance * (1.0 - np.clip(height_fraction, 0.0, 1.0))
    return cost


def utility(gain: FloatArray, cost: FloatArray, gamma: float) -> FloatArray:
    """Utility (ny, nx) [nat] of every viewpoint, eq. 12, with `gamma` in nat per metre."""
    return np.asarray(gain, np.float32) - gamma * cost
