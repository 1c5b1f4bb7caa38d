"""The cloth on the table: a smooth random height field whose unevenness decides trials on thin objects."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import mujoco
import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.workspace import WORKSPACE_CENTRE

HALF_EXTENT = 0.42
"""Half the cloth's edge [m]."""
GRID = 0.007
"""Spacing of the height field's points [m]."""
HEM = 0.03
"""The cloth flattens out towards its edge over this length [m]."""
RGBA = (0.62, 0.60, 0.56, 1.0)


@dataclass(frozen=True, eq=False)
class Cloth:
    """Heights of the cloth over the table; zero beyond its edge."""

    elevation: FloatArray
    """(n, n) [m] at x = WORKSPACE_CENTRE[0] - HALF_EXTENT + col * GRID, y with row likewise; least 0."""

    def height(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height [m] at world positions, on the same triangles that MuJoCo collides with and shows."""
        n = len(self.elevation)
        u = (np.asarray(x, float) - WORKSPACE_CENTRE[0] + HALF_EXTENT) / GRID
        v = (np.asarray(y, float) - WORKSPACE_CENTRE[1] + HALF_EXTENT) / GRID
        inside = (u >= 0) & (u <= n - 1) & (v >= 0) & (v <= n - 1)
        col = np.clip(u.astype(int), 0, n - 2)
        row = np.clip(v.astype(int), 0, n - 2)
        a, b = u - col, v - row
        h = self.elevation
        h00, h11 = h[row, col], h[row + 1, col + 1]
        # each square is split along its diagonal from (row, col) to (row + 1, col + 1)
        corner = np.where(a > b, h[row, col + 1], h[row + 1, col])
        along, across = np.maximum(a, b), np.minimum(a, b)
        return np.where(inside, h00 + along * (corner - h00) + across * (h11 - corner), 0.0)

    def highest(self, x: float, y: float, radius: float) -> float:
        """Highest point [m] within a square of half edge `radius` about (x, y)."""
        n = len(self.elevation)
        low = np.array([y - WORKSPACE_CENTRE[1], x - WORKSPACE_CENTRE[0]]) + HALF_EXTENT
        i, j = np.clip(np.floor((low - radius) / GRID).astype(int), 0, n - 1)
        k, m = np.clip(np.ceil((low + radius) / GRID).astype(int), 0, n - 1)
        return float(self.elevation[i : k + 1, j : m + 1].max())


def make_cloth(
    unevenness: float, wavelength: float, rng: np.random.Generator, wrinkles: FloatArray | None = None
) -> Cloth:
    """A Gaussian random surface.

    Args:
        unevenness: root mean square of the height about its mean, away from the hem [m]; 0 = flat.
        wavelength: mean distance between crests along a straight line [m].
        rng: drawn from the same number of times whatever the other arguments are.
        wrinkles: (n, n) heights on top of the waves [m], if there are any.
    """
    n = round(2 * HALF_EXTENT / GRID) + 1
    noise = rng.standard_normal((n, n))
    if unevenness == 0 and wrinkles is None:
        return Cloth(np.zeros((n, n)))
    # Rice: a line through noise filtered by a Gaussian of sigma s has one crossing up per 2 pi sqrt(2) s
    surface = _smoothed(noise, wavelength / (2 * np.pi * np.sqrt(2)) / GRID)
    hem = round(HEM / GRID)
    inner = surface[hem:-hem, hem:-hem]
    surface = (surface - inner.mean()) * (unevenness / inner.std())
    if wrinkles is not None:
        surface = surface + wrinkles
    edge = np.minimum(np.arange(n), np.arange(n)[::-1]) / hem
    ramp = np.clip(edge, 0, 1)
    surface = (surface - surface.min()) * np.minimum.outer(ramp, ramp)
    return Cloth(surface)


def _smoothed(surface: FloatArray, sigma: float) -> FloatArray:
    """Surface (n, n) through a Gaussian of `sigma` points that goes on at the other side of the cloth."""
    radius = int(4 * sigma + 0.5)
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    padded = np.pad(surface, radius, mode="wrap")
    smooth = np.asarray(cv2.sepFilter2D(padded, cv2.CV_64F, kernel, kernel), float)
    return smooth[radius : len(smooth) - radius, radius : len(smooth) - radius]


def make_wrinkles(height: float, width: float, count: int, rng: np.random.Generator) -> FloatArray:
    """Heights (n, n) [m] of wrinkles at the cloth's points: straight ridges that fade towards their ends.

    Across, a ridge is a Gaussian; along, it keeps its height over the middle half of its length, which is
    drawn from 0.2 to 0.5 m, as its place and its direction are. Where ridges cross, the higher one counts.

    Args:
        height: of a crest [m].
        width: of a ridge at half of its height [m].
        count: number of ridges.
        rng: source of places, directions and lengths.
    """
    axis = np.arange(round(2 * HALF_EXTENT / GRID) + 1) * GRID - HALF_EXTENT
    x, y = np.meshgrid(axis, axis)
    surface = np.zeros_like(x)
    inner = HALF_EXTENT - HEM
    for _ in range(count):
        place, angle, length = rng.uniform(-inner, inner, 2), rng.uniform(0, np.pi), rng.uniform(0.2, 0.5)
        along = (x - place[0]) * np.cos(angle) + (y - place[1]) * np.sin(angle)
        across = (y - place[1]) * np.cos(angle) - (x - place[0]) * np.sin(angle)
        fade = np.clip(2 - 4 * np.abs(along) / length, 0, 1)
        ridge = height * np.exp2(-((2 * across / width) ** 2)) * fade * fade * (3 - 2 * fade)
        np.maximum(surface, ridge, out=surface)
    return np.asarray(surface)


def add_cloth(spec: mujoco.MjSpec, cloth: Cloth) -> None:
    """Lay the cloth on the table as geom "cloth"; a flat one is the table itself, with a coloured sheet."""
    top = float(cloth.elevation.max())
    if top == 0:
        spec.worldbody.add_geom(
            name="cloth",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[HALF_EXTENT, HALF_EXTENT, 0.001],
            pos=[*WORKSPACE_CENTRE, -0.001 + 2e-5],  # a hair above the table, for the renderer
            rgba=list(RGBA),
            contype=0,
            conaffinity=0,
        )
        return
    n = len(cloth.elevation)
    spec.add_hfield(
        name="cloth",
        nrow=n,
        ncol=n,
        size=[HALF_EXTENT, HALF_EXTENT, top, 0.005],
        userdata=(cloth.elevation / top).ravel(),
    )
    spec.worldbody.add_geom(
        name="cloth",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="cloth",
        pos=[*WORKSPACE_CENTRE, 0.0],
        rgba=list(RGBA),
    )
