"""Grasps in the image (eq. 2, 4) and in the world (eq. 1), and the way from one to the other (eq. 3).

The grasp frame, the same as the tool frame `tcp` of the Panda hand, seen from above:

             world y
      x         |      y (closing)
        \\       |     /
          \\     |   /
            \\   | /  angle
              `-o---------- world x

    z (approach) points into the table, y is the direction in which the fingers close, x = y cross z.
    `angle` turns from world x to y about world z, counter-clockwise from above.

A grasp is the same after half a turn, so angles lie in [-pi/2, pi/2). In the image the angle is that
of the closing direction too, counter-clockwise as one looks at the image (v points down), as in the
published GG-CNN code and in the Cornell and Jacquard annotations: direction (du, dv) = (cos, -sin).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import CameraIntrinsics
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down, transform_points, wrap_half_pi


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
        """Pose (4, 4) of the grasp frame."""
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

    def __post_init__(self) -> None:
        shape = (self.intrinsics.height, self.intrinsics.width)
        for name in ("quality", "angle", "width", "depth"):
            if getattr(self, name).shape != shape:
                raise ConfigError(
                    f"grasp map's {name} has the wrong size",
                    got=getattr(self, name).shape,
                    allowed=f"{shape}",
                )

    def world_points(self) -> FloatArray:
        """World points (H, W, 3) [m] of all pixels (eq. 3)."""
        v, u = np.indices(self.depth.shape, sparse=True)
        camera = self.intrinsics.deproject(*np.broadcast_arrays(u, v), self.depth.astype(float))
        return transform_points(self.T_world_camera, camera)

    def world_angle(self) -> FloatArray:
        """Closing directions (H, W) about world z [rad] (eq. 3), for a camera that looks down."""
        return wrap_half_pi(image_to_world_angle(self.angle, self.T_world_camera))

    def world_width(self) -> FloatArray:
        """Openings (H, W) [m] at each pixel's depth (eq. 3)."""
        return self.width * self.depth / self.intrinsics.fx

    def grasp_at(self, row: int, col: int) -> Grasp:
        """The grasp of one pixel in the world (eq. 3)."""
        z = float(self.depth[row, col])
        camera = self.intrinsics.deproject(np.float64(col), np.float64(row), np.float64(z))
        return Grasp(
            position=transform_points(self.T_world_camera, camera),
            angle=float(wrap_half_pi(image_to_world_angle(self.angle[row, col], self.T_world_camera))),
            width=float(self.width[row, col]) * z / self.intrinsics.fx,
            quality=float(self.quality[row, col]),
        )


def image_to_world_angle(angle: FloatArray, T_world_camera: FloatArray) -> FloatArray:
    """Heading in the world's xy plane [rad] of image directions at `angle` [rad], any shape."""
    # (du, dv) = (cos, -sin) is the camera-frame direction (cos, -sin, 0)
    c, s = np.cos(angle), np.sin(angle)
    R = T_world_camera[:3, :3]
    return np.arctan2(c * R[1, 0] - s * R[1, 1], c * R[0, 0] - s * R[0, 1])


def world_to_image_angle(angle: FloatArray, T_world_camera: FloatArray) -> FloatArray:
    """Inverse of `image_to_world_angle` for a camera that looks down, folded to [-pi/2, pi/2)."""
    c, s = np.cos(angle), np.sin(angle)
    R = T_world_camera[:3, :3]  # rows of R.T are the camera axes in the world
    du, dv = c * R[0, 0] + s * R[1, 0], c * R[0, 1] + s * R[1, 1]
    return wrap_half_pi(np.arctan2(-dv, du))
