"""Multi-view picking as it was published, in plain loops: the oracle for `controllers.mvp`.

Written from eq. 6 to 13 of the paper and from what is known of the published code (Morrison et al., ICRA
2019): a uniform prior of one count in each of the N_theta x N_q bins, which the mean quality includes; cells
never seen and cells of the border have a mean of 0; gain is a mean of entropies under a Gaussian of a sixth
of the field of view, mirrored at the border; cost is 0.2 nat for every 0.15 m between viewpoint and best
cell, times 1 minus the height fraction, from 0 at the start height to 1 at the end of the approach; the
camera goes to the best viewpoint within 0.1 m. It uses nothing of mpgrasp.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

N_QUALITY, N_ANGLE = 10, 18
FLOOR, CEILING = -0.01, 0.17
GAMMA = 0.2 / 0.15
WINDOW = 0.1


class PublishedMvp:
    """Cells of `u` metres, `n` to a side, the corner of the first at (x0, y0)."""

    def __init__(self, n: int, u: float, x0: float, y0: float) -> None:
        self.n, self.u, self.x0, self.y0 = n, u, x0, y0
        self.counts: Counter[tuple[int, int, int]] = Counter()
        """Observations by (row, column, quality bin)."""

    def look(self, points: Array, quality: Array) -> None:
        """Add a view: points (m, 3) in the world, NaN where there was no return, and their quality (m,)."""
        for (x, y, z), q in zip(points.tolist(), quality.tolist(), strict=True):
            if not (math.isfinite(x + y + z + q) and FLOOR <= z <= CEILING):
                continue
            row, col = math.floor((y - self.y0) / self.u), math.floor((x - self.x0) / self.u)
            if 0 <= row < self.n and 0 <= col < self.n:
                self.counts[row, col, min(int(q * N_QUALITY), N_QUALITY - 1)] += 1

    def _histogram(self, row: int, col: int) -> list[float]:
        """Counts by quality, of all angles together, each bin with its share of the prior."""
        return [self.counts[row, col, k] + N_ANGLE for k in range(N_QUALITY)]

    def mean(self) -> Array:
        """Mean quality (n, n) by eq. 7, of observations and prior."""
        values = np.zeros((self.n, self.n))
        for row, col in {(row, col) for row, col, _ in self.counts}:
            if 0 < row < self.n - 1 and 0 < col < self.n - 1:
                q = self._histogram(row, col)
                values[row, col] = sum((k + 0.5) / N_QUALITY * c for k, c in enumerate(q)) / sum(q)
        return values

    def best_cell(self) -> tuple[int, int]:
        """Row and column of the highest mean."""
        row, col = np.unravel_index(np.argmax(self.mean()), (self.n, self.n))
        return int(row), int(col)

    def entropy(self) -> Array:
        """Entropy (n, n) by eq. 10 [nat]."""
        values = np.full((self.n, self.n), math.log(N_QUALITY))
        for row, col in {(row, col) for row, col, _ in self.counts}:
            shares = [c / sum(self._histogram(row, col)) for c in self._histogram(row, col)]
            values[row, col] = -sum(p * math.log(p) for p in shares)
        return values

    def gain(self, sigma: float) -> Array:
        """Expected information gain (n, n) by eq. 11, for a footprint of `sigma` metres."""
        s = sigma / self.u
        reach = math.ceil(3 * s)
        weights = np.array([math.exp(-0.5 * (k / s) ** 2) for k in range(-reach, reach + 1)])
        weights /= weights.sum()
        result = self.entropy()
        for axis in (0, 1):
            padded = np.concatenate([result, np.flip(result, axis)], axis)  # one period of the mirror images
            total = np.zeros_like(result)
            for k, weight in zip(range(-reach, reach + 1), weights, strict=True):
                total += weight * np.take(padded, np.arange(self.n) + k, axis, mode="wrap")
            result = total
        return result

    def utility(self, sigma: float, height_fraction: float) -> Array:
        """Utility (n, n) of every viewpoint by eq. 12 and 13."""
        row, col = self.best_cell()
        centres = (np.arange(self.n) + 0.5) * self.u
        distance = np.hypot(centres - centres[col], (centres - centres[row])[:, None])
        cost = distance * (1 - min(max(height_fraction, 0.0), 1.0))
        return np.asarray(self.gain(sigma) - GAMMA * cost, float)
