"""Dense antipodal, collision-free top-down grasps from a height map and the hand's real geometry.

The map is turned so that the closing direction runs along its rows. There the hand is made of boxes, so
every question is a run length or a rectangular filter: a row-wise run of occupied cells is what the pads
close on, the free run beside it is the pocket for a finger, and sums over the pad's width fit straight
lines to the two edges, which says whether they face the pads and by how much the angle is off.

The analysis assumes how a grasp is executed: the tips go down to the cloth, or as far below the surface as
the palm allows where the object is taller than the fingers. Where a lower neighbour is in the way the tips
stop on it, and the grasp is marked down.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, wrap_half_pi
from mpgrasp.height_map import HeightMap

Float32 = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class HandGeometry:
    """The hand as the analysis sees it: boxes around pads, fingers and palm."""

    finger_width: float = 0.022
    """Breadth of pads and fingers across the closing direction, with a little play [m]."""
    finger_thickness: float = 0.012
    """Space that a finger needs outside of the opening [m]."""
    max_opening: float = 0.080
    """Widest opening between the pads [m]."""
    max_contact_width: float = 0.072
    """Widest thing to close on, so that both fingers still pass beside it [m]."""
    reach: float = 0.042
    """How far the tips go below the surface point before the palm comes near [m]."""
    palm_clearance: float = 0.048
    """How far above the tips anything under the palm may rise [m]."""
    palm_size: tuple[float, float] = (0.200, 0.064)
    """The palm along and across the closing direction [m]."""
    tip_clearance: float = 0.0005
    """Height of the tips over the cloth at the end of the descent [m]."""
    margin: tuple[float, float] = (0.003, 0.008)
    """Least and wanted free space on each side between object and open pad [m]."""
    min_depth: float = 0.0012
    """Least height of the contact above the tips [m]."""
    friction_angle: float = np.deg2rad(25.0)
    """Half the friction cone, on the safe side [rad]."""

    def __post_init__(self) -> None:
        if not 0 < self.max_contact_width < self.max_opening:
            raise ConfigError(
                "contact width outside of the opening",
                got=self.max_contact_width,
                allowed=f"between 0 and max_opening = {self.max_opening}",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class WorldGrasps:
    """The best grasp centred on each cell of a height map."""

    quality: Float32
    """(ny, nx) in [0, 1]; 0 = no grasp."""
    angle: Float32
    """(ny, nx) closing direction about world z [rad], in [-pi/2, pi/2)."""
    width: Float32
    """(ny, nx) opening before the fingers close [m]."""
    height_map: HeightMap
    """The grid and scene that the arrays belong to."""


def antipodal_grasps(
    height_map: HeightMap, hand: HandGeometry | None = None, *, n_angles: int = 18
) -> WorldGrasps:
    """Grasps on every cell of the map; cells of the bare support have none."""
    hand = hand or HandGeometry()
    shape = height_map.height.shape
    quality, angle, width = (np.zeros(shape, np.float32) for _ in range(3))
    grasps = WorldGrasps(quality=quality, angle=angle, width=width, height_map=height_map)
    rows, cols = np.nonzero(height_map.label)
    if not len(rows):
        return grasps
    # only cells near objects matter: a finger, its margin, and the filter's width around them
    pad = int(np.ceil(0.04 / height_map.cell))
    window = (
        slice(max(rows.min() - pad, 0), rows.max() + pad + 1),
        slice(max(cols.min() - pad, 0), cols.max() + pad + 1),
    )
    scene = _Scene.of(height_map, window, hand)
    stack_q = np.empty((n_angles, *scene.label.shape), np.float32)
    stack_w, stack_turn = np.empty_like(stack_q), np.empty_like(stack_q)
    angles = -np.pi / 2 + np.pi * np.arange(n_angles) / n_angles
    for k, theta in enumerate(angles):
        stack_q[k], stack_w[k], stack_turn[k] = _at_angle(scene, theta, hand)
    # a grasp that also holds a little off its angle is the better one
    stack_q = 0.5 * stack_q + 0.25 * (np.roll(stack_q, 1, 0) + np.roll(stack_q, -1, 0)) * (stack_q > 0)
    best = stack_q.argmax(0)[None]
    half_bin = 0.6 * np.pi / n_angles
    turn = np.clip(np.take_along_axis(stack_turn, best, 0)[0], -half_bin, half_bin)
    quality[window] = np.take_along_axis(stack_q, best, 0)[0] * scene.centrality
    angle[window] = np.where(quality[window] > 0, wrap_half_pi(angles[best[0]] + turn), 0)
    width[window] = np.where(quality[window] > 0, np.take_along_axis(stack_w, best, 0)[0], 0)
    return grasps
