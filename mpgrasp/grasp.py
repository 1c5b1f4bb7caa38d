r"""Grasps in the image (eq. 2, 4) and in the world (eq. 1), and the way from one to the other (eq. 3).

The grasp frame, the same as the tool frame `tcp` of the Panda hand, seen from above:

             world y
      x         |      y (closing)
        \       |     /
          \     |   /
            \   | /  angle
              `-o---------- world x

    z (approach) points into the table, y is the direction in which the fingers close, x = y cross z.
    `angle` turns from world x to y about world z, counter-clockwise from above.

A grasp is the same after half a turn, so angles lie in [-pi/2, pi/2). In the image the angle is that
of the closing direction too, counter-clockwise as one looks at the image (v points down), as in the
published GG-CNN code and in the Cornell and Jacquard annotations: direction (du, dv) = (cos, -sin).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpgrasp.depth import CameraIntrinsics
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import (
    FloatArray,
    check_pose,
    invert,
    looking_down,
    transform_points,
    wrap_half_pi,
)

RECTANGLE_JAW = 0.02
"""Nominal width of the jaws in grasp rectangles, across the closing direction [m].

A convention of annotation: rectangles are compared by their overlap, so all of them must have the same jaws.
It is not the width of the hand's pads, which is `robot.hand.FINGER_WIDTH`: with that one every overlap would
be another number.
"""
PEAK_QUALITY = 0.68
"""A quality map has a peak, exist_peak() of Algorithm 1, where its `peak_height` exceeds this.

Chosen by Youden's J over the shipped networks' grasps in held-out scenes (benchmarks/held_out.py,
"together": 0.63 to 0.74); it lies within each network's own interval. Quality is the probability of a lift.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Grasp:
    """A top-down grasp in the world, eq. 1: g = {p, theta, w, q}."""

    position: FloatArray
    """(3,) point on the seen surface, centred between the fingers [m]."""
    angle: float
    """Closing direction about world z [rad], in [-pi/2, pi/2)."""
    width: float
    """Opening of the gripper before it closes [m]."""
    quality: float
    """Chance of success as the detector sees it, in [0, 1]."""

    def T_world_grasp(self) -> FloatArray:
        """Return the pose (4, 4) of the grasp frame."""
        # looking_down(yaw) has its y axis at heading yaw - pi/2
        return looking_down(self.position, self.angle + np.pi / 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class GraspMap:
    """A grasp for every pixel, eq. 4: G = (Q, Theta, W), with the geometry of its image."""

    quality: NDArray[np.float32]
    """(H, W), Q in [0, 1]."""
    angle: NDArray[np.float32]
    """(H, W), Theta: closing direction in the image [rad], counter-clockwise on screen."""
    width: NDArray[np.float32]
    """(H, W), W: opening in pixels of this map."""
    depth: NDArray[np.float32]
    """(H, W) z-depth of the same image, holes filled [m]; NaN where nothing could be filled in."""
    intrinsics: CameraIntrinsics
    T_world_camera: FloatArray
    """(4, 4)"""
    time: float = 0.0
    """Simulated time of the image [s]."""
    measured: NDArray[np.bool_] | None = None
    """(H, W), True where the camera had a return and False where the depth was filled in; None if unknown."""

    def __post_init__(self) -> None:
        shape = (self.intrinsics.height, self.intrinsics.width)
        arrays = ("quality", "angle", "width", "depth", *(() if self.measured is None else ("measured",)))
        for name in arrays:
            if not isinstance(getattr(self, name), np.ndarray):
                raise ConfigError(
                    f"grasp map's {name} is no numpy array",
                    got=type(getattr(self, name)),
                    allowed="a numpy array; of a tensor of torch, tensor.detach().cpu().numpy()",
                )
            if getattr(self, name).shape != shape:
                raise ConfigError(
                    f"grasp map's {name} has the wrong size",
                    got=getattr(self, name).shape,
                    allowed=f"{shape}",
                )
        check_pose(self.T_world_camera, "grasp map's T_world_camera")

    def world_points(self) -> FloatArray:
        """Return world points (H, W, 3) [m] of all pixels (eq. 3)."""
        return np.stack(self.world_coordinates(0, 1, 2), axis=-1)

    def world_coordinates(self, *axes: int) -> list[FloatArray]:
        """Return x (axis 0), y (1) or z (2) in the world, each (H, W) [m], of all pixels (eq. 3)."""
        k, z = self.intrinsics, self.depth.astype(float)
        x = (np.arange(k.width) - k.cx) / k.fx * z
        y = ((np.arange(k.height) - k.cy) / k.fy)[:, None] * z
        found = []
        for axis in axes:
            along, across, deep = self.T_world_camera[axis, :3]
            points: FloatArray = x * along + z * deep
            points += y * across
            points += self.T_world_camera[axis, 3]
            found.append(points)
        return found

    def world_width(self) -> FloatArray:
        """Return openings (H, W) [m] at each pixel's depth (eq. 3)."""
        return self.width * self.depth / self.intrinsics.fx

    def rectangle_of(self, grasp: Grasp) -> GraspRectangle:
        """Return the rectangle of a grasp in this image, with jaws `RECTANGLE_JAW` wide."""
        camera = transform_points(invert(self.T_world_camera), np.asarray(grasp.position, float))
        u, v = self.intrinsics.project(camera)
        px_per_metre = self.intrinsics.fx / float(camera[2])
        return GraspRectangle(
            u=float(u),
            v=float(v),
            angle=float(world_to_image_angle(grasp.angle, self.T_world_camera)),
            width_px=grasp.width * px_per_metre,
            jaw_px=RECTANGLE_JAW * px_per_metre,
        )

    def grasp_at(self, row: int, col: int) -> Grasp:
        """Return the grasp of one pixel in the world (eq. 3)."""
        z = float(self.depth[row, col])
        k = self.intrinsics
        camera = k.deproject(np.array(float(col)), np.array(float(row)), np.array(z))
        angle = image_to_world_angle(float(self.angle[row, col]), self.T_world_camera)
        return Grasp(
            position=transform_points(self.T_world_camera, camera),
            angle=float(wrap_half_pi(angle)),
            width=float(self.width[row, col]) * z / k.fx,
            quality=float(self.quality[row, col]),
        )


def image_to_world_angle(angle: ArrayLike, T_world_camera: FloatArray) -> FloatArray:
    """Return the heading in the world's xy plane [rad] of image directions at `angle` [rad], any shape."""
    # (du, dv) = (cos, -sin) is the camera-frame direction (cos, -sin, 0)
    c, s = np.cos(angle), np.sin(angle)
    R = T_world_camera[:3, :3]
    heading: FloatArray = np.arctan2(c * R[1, 0] - s * R[1, 1], c * R[0, 0] - s * R[0, 1])
    return heading


def world_to_image_angle(angle: ArrayLike, T_world_camera: FloatArray) -> FloatArray:
    """Inverse of `image_to_world_angle` for a camera that looks down, folded to [-pi/2, pi/2)."""
    c, s = np.cos(angle), np.sin(angle)
    R = T_world_camera[:3, :3]  # rows of R.T are the camera axes in the world
    du, dv = c * R[0, 0] + s * R[1, 0], c * R[0, 1] + s * R[1, 1]
    return wrap_half_pi(np.arctan2(-dv, du))


@dataclass(frozen=True, kw_only=True)
class GraspRectangle:
    """A grasp in the image, eq. 2, drawn as the rectangle between the fingers."""

    u: float
    """Centre, column [px]."""
    v: float
    """Centre, row [px]."""
    angle: float
    """Closing direction in the image [rad], counter-clockwise on screen."""
    width_px: float
    """Opening, along the closing direction [px]."""
    jaw_px: float
    """Width of the fingers, across the closing direction [px]."""

    def corners(self) -> FloatArray:
        """Return corners (4, 2) as (u, v) [px]; the first edge runs along the closing direction."""
        along = np.array([np.cos(self.angle), -np.sin(self.angle)]) * self.width_px / 2
        across = np.array([np.sin(self.angle), np.cos(self.angle)]) * self.jaw_px / 2
        corners = np.array([-along - across, along - across, along + across, -along + across])
        result: FloatArray = corners + np.array([self.u, self.v])
        return result

    def iou(self, other: GraspRectangle) -> float:
        """Return the area shared with `other` over the area of both together, in [0, 1]."""
        mine, theirs = self.width_px * self.jaw_px, other.width_px * other.jaw_px
        if min(mine, theirs) <= 0:
            return 0.0
        shared = _area(self._clipped(other))
        return min(max(shared / (mine + theirs - shared), 0.0), 1.0)

    def _clipped(self, other: GraspRectangle) -> list[tuple[float, float]]:
        """Return the polygon that both share, in this rectangle's own axes, from its centre [px]."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        shifted = (other.corners() - (self.u, self.v)).tolist()
        polygon = [(cos * u - sin * v, sin * u + cos * v) for u, v in shifted]
        for axis, bound in ((0, self.width_px / 2), (1, self.jaw_px / 2)):
            for sign in (1.0, -1.0):
                polygon = _cut(polygon, axis, sign, bound)
        return polygon


def _cut(
    polygon: list[tuple[float, float]], axis: int, sign: float, bound: float
) -> list[tuple[float, float]]:
    """Return the part of a convex polygon whose coordinate of an axis, times a sign, is at most a bound."""
    kept: list[tuple[float, float]] = []
    for (a, b), here, there in (
        ((p, q), bound - sign * p[axis], bound - sign * q[axis])
        for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True)
    ):
        if here >= 0:
            kept.append(a)
        if here * there < 0:
            share = here / (here - there)
            kept.append((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
    return kept


def _area(polygon: list[tuple[float, float]]) -> float:
    """Return the area of a polygon, by the shoelace formula."""
    pairs = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2


def best_pixel(quality: FloatArray) -> tuple[int, int]:
    """Return (row, col) of the highest quality (H, W); of a flat top, the pixel that lies deepest inside.

    NaN and -inf never win; where nothing is finite the answer is (0, 0).
    """
    finite = np.where(np.isfinite(quality), quality, -np.inf)
    top = finite >= finite.max()
    if top.sum() > 1:
        # a saturated detector would otherwise always be grasped at its top-left corner
        depth_inside = cv2.distanceTransform(top.astype(np.uint8), cv2.DIST_L2, 3)
        row, col = np.unravel_index(np.argmax(depth_inside), top.shape)
    else:
        row, col = np.unravel_index(np.argmax(top), top.shape)
    return int(row), int(col)


def peaks(
    quality: FloatArray, *, threshold: float = 0.1, distance: float = 10.0, count: int | None = None
) -> NDArray[np.intp]:
    """Return local maxima (n, 2) as (row, col), best first, `distance` [px] or more apart, above `threshold`.

    Of maxima that are closer than that, the better one stays (non-maximum suppression).
    """
    image = np.where(np.isfinite(quality), quality, -1.0).astype(np.float32)
    highest_around = cv2.dilate(image, np.ones((3, 3), np.uint8))
    candidates = np.argwhere((image >= highest_around) & (image > threshold))
    order = np.argsort(-image[candidates[:, 0], candidates[:, 1]], kind="stable")
    candidates = candidates[order]
    chosen: list[NDArray[np.intp]] = []
    while len(candidates) and (count is None or len(chosen) < count):
        best = candidates[0]
        chosen.append(best)
        apart = np.hypot(*(candidates - best).T) >= distance
        apart[0] = False
        candidates = candidates[apart]
    return np.array(chosen, np.intp).reshape(-1, 2)


def peak_height(quality: FloatArray) -> float:
    """Return the highest 3x3 mean of a quality map (H, W), for exist_peak() to compare with a threshold."""
    finite = quality if np.isfinite(quality).all() else np.nan_to_num(quality)
    image = finite.astype(np.float32, copy=False)
    return float(cv2.blur(image, (3, 3), borderType=cv2.BORDER_REPLICATE).max())
