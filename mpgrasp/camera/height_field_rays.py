"""Rays from one point onto a MuJoCo height field, all at once.

A ray steeper than the steepest triangle comes down on the surface exactly once, so a Newton iteration that
steps from the plane of one triangle to that of the next needs no search; whatever is not settled by that is
reported for somebody else to settle.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.geometry import FloatArray

_ROUNDS = 8
_SAME = 2e-7  # [m], a step of the iteration that changes nothing
_STEEPER = 1.01  # by which rays are steeper than the surface

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Triangles:
    """Planes z = level + along u + across v over the grid's coordinates u (columns) and v (rows).

    The two triangles of a square follow each other, first the one where v - row is more than u - col.
    """

    level: Image
    along: Image
    across: Image
    rows: int
    cols: int

    def index(self, u: Image, v: Image) -> NDArray[np.intp]:
        """Triangles under the points, of the nearest square outside of the field."""
        col = np.minimum(np.maximum(u, 0), self.cols - 2).astype(np.int32)
        row = np.minimum(np.maximum(v, 0), self.rows - 2).astype(np.int32)
        right = u - col > v - row
        row *= self.cols - 1
        row += col
        row *= 2
        row += right
        return row.astype(np.intp)


def _triangles(model: mujoco.MjModel, field: int) -> _Triangles:
    rows, cols = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    start = model.hfield_adr[field]
    h = model.hfield_data[start : start + rows * cols].reshape(rows, cols) * model.hfield_size[field, 2]
    h00, h01, h10, h11 = h[:-1, :-1], h[:-1, 1:], h[1:, :-1], h[1:, 1:]
    along = np.stack([h11 - h10, h01 - h00], axis=-1)
    across = np.stack([h10 - h00, h11 - h01], axis=-1)
    row, col = np.arange(rows - 1)[:, None, None], np.arange(cols - 1)[None, :, None]
    level = h00[..., None] - along * col - across * row
    flat = [np.ascontiguousarray(a, np.float32).ravel() for a in (level, along, across)]
    return _Triangles(level=flat[0], along=flat[1], across=flat[2], rows=rows, cols=cols)


def height_field_depth(
    model: mujoco.MjModel, field: int, origin: FloatArray, directions: tuple[Image, Image, Image]
) -> tuple[Image, Mask]:
    """Return the depth at which rays meet a height field.

    Args:
        model: holds the field.
        field: index of the field.
        origin: (3,) start of the rays in the field's frame [m].
        directions: x, y and z of the rays in that frame, one array each and all of one shape.

    Returns:
        Distances in units of the directions' lengths, inf for rays that pass by; and the rays whose distance
        is not known: flat ones, those at the field's rim, and all if the start is not above the field.
    """
    half_x, half_y, top, base = model.hfield_size[field]
    dx, dy, dz = (d.ravel() for d in directions)
    shape = directions[0].shape
    if origin[2] <= top:
        return np.full(shape, np.inf, np.float32), np.ones(shape, bool)
    tri = _triangles(model, field)
    per_x, per_y = (tri.cols - 1) / (2 * half_x), (tri.rows - 1) / (2 * half_y)
    u0, v0 = np.float32((origin[0] + half_x) * per_x), np.float32((origin[1] + half_y) * per_y)
    z0 = np.float32(origin[2])
    du, dv = dx * np.float32(per_x), dy * np.float32(per_y)

    slope = np.sqrt(np.max((tri.along * per_x) ** 2 + (tri.across * per_y) ** 2))
    flat = dz >= 0
    flat |= dz * dz <= np.float32((_STEEPER * slope) ** 2) * (dx * dx + dy * dy)

    middle = np.float32(tri.level[0] if slope == 0 else 0.5 * top)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (middle - z0) / dz
        t[flat] = 0
        found = tri.index(u0 + t * du, v0 + t * dv)
        left = np.arange(t.size)
        ray_u, ray_v, ray_z, guess = du, dv, dz, t
        for _ in range(_ROUNDS):
            along, across = tri.along[found], tri.across[found]
            better = tri.level[found] + along * u0 + across * v0 - z0
            better /= ray_z - along * ray_u - across * ray_v
            there = tri.index(u0 + better * ray_u, v0 + better * ray_v)
            open_ = (there != found) & ~(np.abs(better - guess) <= _SAME)
            t[left] = better
            left = left[open_]
            if not left.size:
                break
            found, guess = there[open_], better[open_]
            ray_u, ray_v, ray_z = du[left], dv[left], dz[left]
        unknown = flat
        unknown[left] = True
        u, v = u0 + t * du, v0 + t * dv
    last_u, last_v = tri.cols - 1, tri.rows - 1
    outside = ~((u > 0) & (u < last_u) & (v > 0) & (v < last_v)) & ~unknown
    out = np.flatnonzero(outside)
    enter, leave = (top - z0) / dz[out], (-base - z0) / dz[out]
    passes = np.zeros(len(out), bool)
    for start, step, last in ((u0, du[out], last_u), (v0, dv[out], last_v)):
        a, b = start + enter * step, start + leave * step
        passes |= (np.maximum(a, b) < 0) | (np.minimum(a, b) > last)
    t[out] = np.inf
    unknown[out[~passes]] = True
    return t.reshape(shape), unknown.reshape(shape)
