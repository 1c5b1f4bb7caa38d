"""Boxes on a bare table, as a depth camera sees them and as a height map: known answers for detectors.

Depth is worked out ray by ray, without noise: where a ray meets the slabs of a box or the table first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.height_map import HeightMap
from mpgrasp.workspace import WORKSPACE_CENTRE, WORKSPACE_REACH

CELL = 0.002
"""Edge of a cell of the height map [m]."""
_COLOURS = np.array([[90, 95, 100], [200, 120, 60], [60, 140, 200], [120, 180, 90], [190, 180, 70]], np.uint8)


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box that stands on the table."""

    x: float = WORKSPACE_CENTRE[0]
    y: float = WORKSPACE_CENTRE[1]
    yaw: float = 0.0
    """Heading of the length [rad]."""
    length: float
    breadth: float
    height: float

    @property
    def across(self) -> float:
        """Direction in which a hand closes on its breadth [rad]."""
        return self.yaw + np.pi / 2

    def local(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return offsets along the length and along the breadth of world points or directions."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return c * x + s * y, -s * x + c * y

    def mirrored(self) -> Box:
        """Return it on the other side of the plane y = 0."""
        return replace(self, y=-self.y, yaw=-self.yaw)


def frame(
    *boxes: Box,
    height: float,
    yaw: float = 0.0,
    colour: bool = False,
    intrinsics: CameraIntrinsics | None = None,
) -> DepthFrame:
    """Return the view of a camera that looks straight down on the workspace's centre.

    Args:
        boxes: on the table.
        height: of the camera over the table [m].
        yaw: heading of the image's u axis, as of `looking_down` [rad].
        colour: with `rgb`.
        intrinsics: of the image; those of the benchmark's camera unless given.
    """
    k = intrinsics or D435_INTRINSICS
    T = looking_down([*WORKSPACE_CENTRE, height], yaw)
    v, u = np.indices((k.height, k.width)).astype(float)
    rays = k.deproject(u, v, np.ones_like(u)) @ T[:3, :3].T  # (H, W, 3), of z-depth 1
    depth, what = -T[2, 3] / rays[..., 2], np.zeros(u.shape, int)
    for number, box in enumerate(boxes, 1):
        met = _box_depth(box, T[:3, 3], rays)
        what[met < depth] = number
        depth = np.minimum(depth, met)
    return DepthFrame(
        depth=depth.astype(np.float32),
        intrinsics=k,
        T_world_camera=T,
        rgb=_COLOURS[what % len(_COLOURS)] if colour else None,
    )


def _box_depth(box: Box, origin: FloatArray, rays: FloatArray) -> FloatArray:
    """Return the z-depth (H, W) [m] at which rays enter a box; infinite where they miss it."""
    start = (*box.local(origin[0] - box.x, origin[1] - box.y), origin[2] - box.height / 2)
    way = (*box.local(rays[..., 0], rays[..., 1]), rays[..., 2])
    enter, leave = np.zeros(rays.shape[:2]), np.full(rays.shape[:2], np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for at, along, side in zip(start, way, (box.length, box.breadth, box.height), strict=True):
            ends = (-side / 2 - at) / along, (side / 2 - at) / along
            enter, leave = np.fmax(enter, np.fmin(*ends)), np.fmin(leave, np.fmax(*ends))
    return np.where(enter < leave, enter, np.inf)


def truth(boxes: Sequence[Box]) -> HeightMap:
    """Return the true shape of the workspace."""
    n = round(WORKSPACE_REACH / CELL)
    axis = np.arange(-n, n + 1) * CELL
    x, y = np.meshgrid(WORKSPACE_CENTRE[0] + axis, WORKSPACE_CENTRE[1] + axis)
    height, label = np.zeros(x.shape), np.zeros(x.shape, int)
    for number, box in enumerate(boxes, 1):
        along, across = box.local(x - box.x, y - box.y)
        inside = (
            (np.abs(along) <= box.length / 2) & (np.abs(across) <= box.breadth / 2) & (height < box.height)
        )
        height[inside], label[inside] = box.height, number
    return HeightMap(
        height=height,
        support=np.zeros_like(height),
        label=label,
        x0=float(x[0, 0]),
        y0=float(y[0, 0]),
        cell=CELL,
    )
