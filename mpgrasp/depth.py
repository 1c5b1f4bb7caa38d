"""Depth frames and the camera geometry that takes pixels to the world and back.

Pixel coordinates are (u, v) = (column, row), with integers at pixel centres. Depth is z-depth along
the optical axis [m]; NaN means no return. Camera axes are OpenCV's: x right, y down, z forward.

Cropping and resizing return a new frame with the intrinsics of the new image, so that a pixel of a
cropped and resized image maps to the world (the paper's eq. 3) by the same formula as any other.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, invert, transform_points


@dataclass(frozen=True, kw_only=True)
class CameraIntrinsics:
    """Pinhole intrinsics of an image of (height, width) pixels."""

    fx: float
    """Focal length along u [px]."""
    fy: float
    """Focal length along v [px]."""
    cx: float
    """Principal point, column [px]."""
    cy: float
    """Principal point, row [px]."""
    width: int
    """Columns."""
    height: int
    """Rows."""

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or min(self.fx, self.fy) <= 0:
            raise ConfigError("unusable camera intrinsics", got=self, allowed="positive size and focal lengths")

    def crop(self, row: float, col: float, height: int, width: int) -> CameraIntrinsics:
        """Intrinsics of the window whose top-left pixel is (row, col)."""
        return CameraIntrinsics(
            fx=self.fx, fy=self.fy, cx=self.cx - col, cy=self.cy - row, width=width, height=height
        )

    def resize(self, height: int, width: int) -> CameraIntrinsics:
        """Intrinsics after a resize to (height, width) that aligns the image's outer edges."""
        sx, sy = width / self.width, height / self.height
        return CameraIntrinsics(
            fx=self.fx * sx,
            fy=self.fy * sy,
            cx=(self.cx + 0.5) * sx - 0.5,
            cy=(self.cy + 0.5) * sy - 0.5,
            width=width,
            height=height,
        )

    def deproject(self, u: FloatArray, v: FloatArray, z: FloatArray) -> FloatArray:
        """Camera-frame points (..., 3) [m] of pixels (u, v) at z-depth z [m]."""
        z = np.asarray(z)
        return np.stack([(u - self.cx) / self.fx * z, (v - self.cy) / self.fy * z, z], axis=-1)

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (..., 2) as (u, v) of camera-frame points (..., 3) [m] in front of the camera."""
        x, y, z = np.moveaxis(points, -1, 0)
        return np.stack([x / z * self.fx + self.cx, y / z * self.fy + self.cy], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthFrame:
    """One depth image with its geometry."""

    depth: NDArray[np.float32]
    """(H, W) z-depth [m], NaN = no return."""
    intrinsics: CameraIntrinsics
    T_world_camera: FloatArray
    """(4, 4) pose of the OpenCV camera frame in the world."""
    time: float = 0.0
    """Simulated time of the exposure [s]."""
    rgb: NDArray[np.uint8] | None = field(default=None)
    """(H, W, 3) colour image of the same geometry, where one was asked for."""

    def __post_init__(self) -> None:
        if self.depth.shape != (self.intrinsics.height, self.intrinsics.width):
            raise ConfigError(
                "depth image and intrinsics disagree in size",
                got=self.depth.shape,
                allowed=f"{(self.intrinsics.height, self.intrinsics.width)}",
            )

    def world_points(self) -> FloatArray:
        """World points (H, W, 3) [m] of all pixels; NaN where there was no return."""
        v, u = np.indices(self.depth.shape, sparse=True)
        z = self.depth.astype(float)
        camera = self.intrinsics.deproject(*np.broadcast_arrays(u, v), z)
        return transform_points(self.T_world_camera, camera)

    def pixels(self, points: FloatArray) -> FloatArray:
        """Pixels (..., 2) as (u, v) of world points (..., 3) [m]."""
        return self.intrinsics.project(transform_points(invert(self.T_world_camera), points))
