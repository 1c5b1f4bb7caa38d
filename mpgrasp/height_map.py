"""The true shape of a scene seen from above, on a regular grid: what the oracle and the labels read."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightMap:
    """Surface height above the table plane z = 0 on a grid of square cells.

    `height[row, col]` is at world x = x0 + col * cell, y = y0 + row * cell (cell centres).
    """

    height: FloatArray
    """(ny, nx) [m], highest surface in each cell's centre line."""
    support: FloatArray
    """(ny, nx) [m], height of the bare table and cloth below the objects."""
    label: np.ndarray
    """(ny, nx) int: 0 = support, k > 0 = object k - 1 of the scene."""
    x0: float
    """World x of column 0 [m]."""
    y0: float
    """World y of row 0 [m]."""
    cell: float
    """Edge of a cell [m]."""

    def __post_init__(self) -> None:
        shapes = {array.shape for array in (self.height, self.support, self.label)}
        if len(shapes) > 1 or self.height.ndim != 2 or not self.height.size:
            raise ConfigError("maps of a height map differ in size", got=shapes, allowed="one size (ny, nx)")
        place = (self.x0, self.y0, self.cell)
        if not (all(map(math.isfinite, place)) and self.cell > 0):
            raise ConfigError(
                "unusable place or cell of a height map", got=place, allowed="finite, cell above 0"
            )

    def cells(self, x: FloatArray, y: FloatArray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(row, col, inside) of world positions; rows and columns are clipped, `inside` tells where."""
        finite = np.isfinite(x) & np.isfinite(y)
        if not finite.all():
            x, y = np.where(finite, x, 0), np.where(finite, y, 0)
        col = np.rint((x - self.x0) / self.cell).astype(int)
        row = np.rint((y - self.y0) / self.cell).astype(int)
        ny, nx = self.height.shape
        near_row, near_col = np.minimum(np.maximum(row, 0), ny - 1), np.minimum(np.maximum(col, 0), nx - 1)
        return near_row, near_col, finite & (near_row == row) & (near_col == col)
