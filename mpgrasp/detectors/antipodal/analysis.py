"""Dense antipodal, collision-free top-down grasps from a height map and the hand's real geometry.

The map is turned so that the closing direction runs along its rows. There the hand is made of boxes, so
every question is a run length or a rectangular filter: a row-wise run of occupied cells is what the pads
close on, the free run beside it is the pocket for a finger, and sums over the pad's width fit straight
lines to the two edges, which say whether they face the pads and by how much the angle is off.

The analysis assumes how a grasp is executed: the tips go down to the cloth, or as far below the surface as
the palm allows where the object is taller than the fingers. Where something lower is in the way the tips
stop on it, and the grasp is marked down.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.detectors.antipodal.turned_map import TurnedMap
from mpgrasp.detectors.antipodal.windows import Float32, odd
from mpgrasp.geometry import FloatArray, wrap_half_pi
from mpgrasp.height_map import HeightMap
from mpgrasp.linear_algebra import product

SLIDE = 0.010
"""Length across the closing direction over which worth is averaged: the hand may be off [m]."""
WORTH_EXPONENT = 1.6
"""Brings the product of all factors, which is below 1 for the best of grasps, towards 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WorldGrasps:
    """The best grasp centred on each cell of a height map."""

    quality: Float32
    """(ny, nx) in [0, 1]; 0 = no grasp."""
    angle: Float32
    """(ny, nx) closing direction about world z [rad], in [-pi/2, pi/2)."""
    width: Float32
    """(ny, nx) what to close on and a margin; the execution adds its own to it [m]."""
    height_map: HeightMap
    """The grid and scene that the arrays belong to."""


def antipodal_grasps(
    height_map: HeightMap, hand: HandGeometry | None = None, *, n_angles: int = 18
) -> WorldGrasps:
    """Return grasps centred on every cell of the map.

    Args:
        height_map: the scene.
        hand: geometry of the gripper.
        n_angles: closing directions that are tried; the result is finer, because edges are fitted.
    """
    hand = hand or HandGeometry()
    quality, angle, width = (np.zeros(height_map.height.shape, np.float32) for _ in range(3))
    grasps = WorldGrasps(quality=quality, angle=angle, width=width, height_map=height_map)
    if not height_map.label.any():
        return grasps
    window, height, label, masses = _around_objects(height_map)
    angles = -np.pi / 2 + np.pi * np.arange(n_angles) / n_angles
    stack = np.stack([_at_angle(height, label, masses, theta, height_map.cell, hand) for theta in angles])
    q, opening, turn = np.moveaxis(stack, -1, 0)  # each (n_angles, h, w)
    # a grasp that still holds a little off its angle is the better one
    robust = np.where(q > 0, 0.5 * q + 0.25 * (np.roll(q, 1, 0) + np.roll(q, -1, 0)), 0)
    # the factors compound; this puts the worth near the rate at which such grasps lift
    robust = 1 - (1 - robust) ** WORTH_EXPONENT
    best = robust.argmax(axis=0)[None]
    quality[window], opening, turn = (np.take_along_axis(a, best, 0)[0] for a in (robust, opening, turn))
    found = quality[window] > 0
    half_bin = 0.6 * np.pi / n_angles
    angle[window] = np.where(found, wrap_half_pi(angles[best[0]] + np.clip(turn, -half_bin, half_bin)), 0)
    width[window] = np.where(found, opening, 0)
    return grasps


def quality_along(height_map: HeightMap, angle: float, hand: HandGeometry | None = None) -> Float32:
    """Return the worth (ny, nx) of grasps that close along `angle` [rad], be it the best there or not."""
    quality = np.zeros(height_map.height.shape, np.float32)
    if height_map.label.any():
        window, height, label, masses = _around_objects(height_map)
        found = _at_angle(height, label, masses, angle, height_map.cell, hand or HandGeometry())
        quality[window] = found[..., 0]
    return quality


def _around_objects(
    height_map: HeightMap,
) -> tuple[tuple[slice, slice], Float32, Float32, FloatArray]:
    """Return the window of the map that matters, its height and label, and the objects' centres of mass."""
    rows, cols = np.nonzero(height_map.label)
    # a finger and its margin beyond the objects
    pad = int(np.ceil(0.04 / height_map.cell))
    window = (
        slice(max(rows.min() - pad, 0), rows.max() + pad + 1),
        slice(max(cols.min() - pad, 0), cols.max() + pad + 1),
    )
    height, label = (np.asarray(a[window], np.float32) for a in (height_map.height, height_map.label))
    above = (height - height_map.support[window]).astype(np.float32)
    return window, height, label, _centres_of_mass(above, label)


def _centres_of_mass(above: Float32, label: Float32) -> FloatArray:
    """Return centres (n_labels, 2) as (row, col) of each object, weighted by height; row 0 is unused."""
    flat = label.astype(int).ravel()
    rows, cols = np.indices(label.shape).reshape(2, -1)
    weight = np.maximum(above.ravel(), 1e-4)
    total = np.maximum(np.bincount(flat, weight), 1e-9)
    return (
        np.column_stack([np.bincount(flat, weight * rows), np.bincount(flat, weight * cols)]) / total[:, None]
    )


def _at_angle(
    height: Float32, label: Float32, masses: FloatArray, theta: float, cell: float, hand: HandGeometry
) -> Float32:
    """Return quality, opening [m] and turn [rad] (h, w, 3) of grasps that close along `theta`."""
    h, w = label.shape
    c, s = np.cos(theta), np.sin(theta)
    R = np.array([[c, -s], [s, c]])  # turned (col, row) offsets -> the map's
    size = np.ceil(product(np.abs(R).T, np.array([w, h], float))).astype(int) + 1
    offset = np.array([w - 1, h - 1]) / 2 - product(R, (size - 1.0) / 2)
    turned = cv2.warpAffine(
        np.dstack([height, label]),
        np.column_stack([R, offset]),
        (int(size[0]), int(size[1])),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
    )
    turned_map = TurnedMap(
        turned[..., 0].astype(np.float32),
        turned[..., 1].astype(np.float32),
        product(masses[:, ::-1] - offset, R),
        cell,
        hand,
    )
    result = np.zeros((*turned.shape[:2], 3), np.float32)
    for level in turned_map.levels():
        part, window = turned_map.around(level)
        if part is not None:
            part.add_grasps(level, result[window])
    q = np.minimum(result[..., :1], 1)
    along = odd(SLIDE / cell)
    # cells are coarse: the worth over a few places, and weighted by it the fitted angle and the opening
    result[..., :1] = np.where(q > 0, cv2.blur(q, (1, along), borderType=cv2.BORDER_CONSTANT)[..., None], 0)
    weighted = cv2.blur(np.dstack([q, q * result[..., 1:]]), (3, along), borderType=cv2.BORDER_CONSTANT)
    result[..., 1:] = weighted[..., 1:] / np.maximum(weighted[..., :1], 1e-6)
    back = np.column_stack([R.T, -product(R.T, offset)])
    return np.asarray(cv2.warpAffine(result, back, (w, h), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP))
