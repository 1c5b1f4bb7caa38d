"""Height maps of simple solids on a flat table, drawn analytically, for tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpgrasp.height_map import HeightMap


@dataclass(frozen=True, kw_only=True)
class Solid:
    """A box or an ellipsoid that lies on the table."""

    x: float
    y: float
    yaw: float
    """Heading of the length [rad]."""
    length: float
    breadth: float
    height: float
    shape: str = "box"


def height_map(*solids: Solid, cell: float = 0.002, half_extent: float = 0.2) -> HeightMap:
    n = round(half_extent / cell)
    axis = np.arange(-n, n + 1) * cell
    # not square, so that swapped axes show
    xs, ys = 0.5 + axis, axis[5:]
    X, Y = np.meshgrid(xs, ys)
    height, label = np.zeros(X.shape), np.zeros(X.shape, int)
    for k, s in enumerate(solids, start=1):
        c, d = np.cos(s.yaw), np.sin(s.yaw)
        u = ((X - s.x) * c + (Y - s.y) * d) / (s.length / 2)
        v = (-(X - s.x) * d + (Y - s.y) * c) / (s.breadth / 2)
        if s.shape == "box":
            top = np.where((np.abs(u) <= 1) & (np.abs(v) <= 1), s.height, 0.0)
        else:
            rest = 1 - u * u - v * v
            top = np.where(rest >= 0, s.height / 2 * (1 + np.sqrt(np.maximum(rest, 0))), 0.0)
        here = top > height
        height[here], label[here] = top[here], k
    return HeightMap(
        height=height, support=np.zeros_like(height), label=label, x0=float(xs[0]), y0=float(ys[0]), cell=cell
    )
