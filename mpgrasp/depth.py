"""Depth frames and the camera geometry that takes pixels to the world and back.

Pixel coordinates are (u, v) = (column, row), with integers at pixel centres. Depth is z-depth along
the optical axis [m]; NaN means no return. Camera axes are OpenCV's: x right, y down, z forward.

Cropping and resizing return a new frame with the intrinsics of the new image, so that a pixel of a
cropped and resized image maps to the world (the paper's eq. 3) by the same formula as any other.
Holes are filled as in the published GG-CNN code (https://github.com/dougsm/ggcnn).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from numbers import Integral, Real

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, check_pose, invert, transform_points
from mpgrasp.readings import check_colour, check_depth, metres

CROP = 350
"""Side of the central square of a 640 x 480 image that detectors see [px], as in published MVP code."""
NETWORK_SIZE = 224
"""Side of the detectors' input [px]."""
EDGE_GAP = 0.010
"""Depths farther apart than this are two surfaces, and are never averaged into one [m]."""


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
        size, numbers = (self.width, self.height), (self.fx, self.fy, self.cx, self.cy)
        whole = all(isinstance(n, Integral) and n >= 1 for n in size)
        real = all(isinstance(x, Real) and math.isfinite(x) for x in numbers)
        if not (whole and real and min(self.fx, self.fy) > 0):
            raise ConfigError(
                "unusable camera intrinsics",
                got=self,
                allowed="a size in whole pixels from 1, focal lengths above 0, all of them finite",
            )

    def crop(self, row: float, col: float, height: int, width: int) -> CameraIntrinsics:
        """Intrinsics of the window whose top-left pixel is (row, col)."""
        return CameraIntrinsics(
            fx=self.fx, fy=self.fy, cx=self.cx - col, cy=self.cy - row, width=width, height=height
        )

    def centre_crop(self, size: int) -> CameraIntrinsics:
        """Intrinsics of the central square of `size` px; where it cannot be central it lies up and left.

        Raises:
            ConfigError: the image is smaller than that.
        """
        row, col = _centre_window(self.height, self.width, size)
        return self.crop(row, col, size, size)

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


def _centre_window(height: int, width: int, size: int) -> tuple[int, int]:
    if not 1 <= size <= min(height, width):
        raise ConfigError("unusable crop size [px]", got=size, allowed=f"1 to {min(height, width)}")
    return (height - size) // 2, (width - size) // 2


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthFrame:
    """One depth image with its geometry.

    Raises:
        ConfigError: what is no float32 image in metres with NaN for "no return", no rigid pose, or of another
            size than the intrinsics. `from_camera` takes images in the form that cameras give them.
    """

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
        if not isinstance(self.intrinsics, CameraIntrinsics):
            raise ConfigError("no camera intrinsics", got=self.intrinsics, allowed="CameraIntrinsics")
        shape = (self.intrinsics.height, self.intrinsics.width)
        check_depth(self.depth, shape)
        check_pose(self.T_world_camera, "T_world_camera")
        if self.rgb is not None:
            check_colour(self.rgb, shape)
        if not (isinstance(self.time, Real) and math.isfinite(self.time)):
            raise ConfigError("unusable time of a frame [s]", got=self.time, allowed="a finite number")

    @classmethod
    def from_camera(
        cls,
        depth: NDArray[np.generic],
        *,
        intrinsics: CameraIntrinsics,
        T_world_camera: FloatArray,
        unit: float,
        no_return: float | Iterable[float],
        time: float = 0.0,
        rgb: NDArray[np.uint8] | None = None,
    ) -> DepthFrame:
        """Return the frame of a camera's own depth image; `mpgrasp.readings` has the table of cameras.

        Args:
            depth: (H, W) readings, z-depth along the optical axis.
            intrinsics: of that image.
            T_world_camera: (4, 4) pose of the OpenCV camera frame in the world.
            unit: length that a reading of 1 stands for [m]: 0.001 for millimetres.
            no_return: reading, or readings, of a pixel without a return; NaN is one always.
            time: of the exposure [s].
            rgb: (H, W, 3) colour image of the same geometry.

        Raises:
            ConfigError: an image, unit, pose or size that cannot be used.
        """
        return cls(
            depth=metres(depth, unit, no_return),
            intrinsics=intrinsics,
            T_world_camera=T_world_camera,
            time=time,
            rgb=rgb,
        )

    @functools.cached_property
    def _squares(self) -> dict[tuple[int, int], NDArray[np.float32]]:
        """Depth of what `crop_resize` was asked for, by crop and size: detector and policy see the same."""
        return {}

    def world_points(self) -> FloatArray:
        """World points (H, W, 3) [m] of all pixels; NaN where there was no return."""
        v, u = np.indices(self.depth.shape).astype(float)
        camera = self.intrinsics.deproject(u, v, self.depth.astype(float))
        return transform_points(self.T_world_camera, camera)

    def pixels(self, points: FloatArray) -> FloatArray:
        """Pixels (..., 2) as (u, v) of world points (..., 3) [m]."""
        return self.intrinsics.project(transform_points(invert(self.T_world_camera), points))


def crop_resize(frame: DepthFrame, crop: int = CROP, size: int = NETWORK_SIZE) -> DepthFrame:
    """The central square of `crop` px, resized to `size` px.

    Each new pixel takes the surface of the old pixel at its centre, averaged by area over the part of its
    footprint that lies within `EDGE_GAP` of it: noise is averaged, while no depth is invented between an
    object and its background and no hole spreads. Where the centre is a hole, so is the new pixel.

    Raises:
        ConfigError: the image is smaller than `crop`, or `size` < 1.
    """
    if size < 1:
        raise ConfigError("unusable image size [px]", got=size, allowed="1 or more")
    row, col = _centre_window(frame.intrinsics.height, frame.intrinsics.width, crop)
    window = np.s_[row : row + crop, col : col + crop]
    rgb = None
    if frame.rgb is not None:
        resized = cv2.resize(frame.rgb[window], (size, size), interpolation=cv2.INTER_AREA)
        rgb = np.asarray(resized, np.uint8)
    if (crop, size) not in frame._squares:
        frame._squares[crop, size] = _resize_by_area(frame.depth[window], size)
    return replace(
        frame,
        depth=frame._squares[crop, size].copy(),
        intrinsics=frame.intrinsics.centre_crop(crop).resize(size, size),
        rgb=rgb,
    )


def _resize_by_area(depth: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Square depth image resized to `size` px; see `crop_resize`."""
    old = len(depth)
    if old == size:
        return depth.copy()
    centre = _footprint(old, size)[2]
    if old < size:  # where OpenCV would interpolate
        every = np.indices((size, size))
        return _averaged_by_hand(depth, every[0], every[1], size)
    holes = np.isnan(depth)
    known = np.where(holes, np.float32(-1), depth) if (holed := bool(holes.any())) else depth
    result = np.asarray(cv2.resize(known, (size, size), interpolation=cv2.INTER_AREA), np.float32)
    # a footprint reaches no farther from its centre: where all of that is one surface, OpenCV is right
    kernel = np.ones((2 * -(-old // (2 * size)) + 1,) * 2, np.uint8)
    spread = cv2.dilate(known, kernel) - cv2.erode(known, kernel)
    mixed = spread.take(centre, axis=0).take(centre, axis=1) >= EDGE_GAP
    if holed:
        lost = holes.take(centre, axis=0).take(centre, axis=1)
        result[lost] = np.nan
        mixed &= ~lost
    rows, cols = np.divmod(np.flatnonzero(mixed), size)
    result[rows, cols] = _averaged_by_hand(depth, rows, cols, size)
    return result


def _averaged_by_hand(
    depth: NDArray[np.float32], rows: NDArray[np.intp], cols: NDArray[np.intp], size: int
) -> NDArray[np.float32]:
    """Pixels (...) at `rows` and `cols` (...) of an image resized to `size` px, at edges and holes too."""
    index, weight, centre = _footprint(len(depth), size)
    reference = depth[centre[rows], centre[cols]]
    total, mass = np.zeros_like(reference), np.zeros_like(reference)
    across = [(index[k][cols], weight[k][cols]) for k in range(len(index))]
    for k in range(len(index)):
        row, row_weight = index[k][rows] * depth.shape[1], weight[k][rows]
        for col, col_weight in across:
            offset = depth.take(row + col) - reference
            near = np.abs(offset) < EDGE_GAP  # False where either is NaN
            w = row_weight * col_weight * near
            mass += w
            total += w * np.where(near, offset, np.float32(0))
    return np.asarray(reference + total / np.where(mass > 0, mass, 1))


@functools.lru_cache(maxsize=8)
def _footprint(old: int, new: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Old pixels under each new one along an axis: index and overlap (k, new), and the central one (new,)."""
    start = np.arange(new) * old / new
    end = start + old / new
    index = np.floor(start).astype(int) + np.arange(int(np.ceil(old / new)) + 1)[:, None]
    weight = np.clip(np.minimum(index + 1, end) - np.maximum(index, start), 0, None).astype(np.float32)
    used = weight.max(axis=1) > 1e-6
    centre = np.floor((start + end) / 2).astype(int)
    return np.minimum(index, old - 1)[used], weight[used], centre


def inpaint(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Copy of a depth image (H, W) [m] with its holes filled from their rims; all NaN stays all NaN."""
    holes = np.isnan(depth)
    if not holes.any() or holes.all():
        return depth.copy()
    # cv2 leaves the outermost pixels alone, hence the border of one pixel
    padded = cv2.copyMakeBorder(np.where(holes, 0, depth), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    mask = cv2.copyMakeBorder(holes.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    filled = cv2.inpaint(padded.astype(np.float32), mask, 1, cv2.INPAINT_NS)
    return np.asarray(filled, np.float32)[1:-1, 1:-1].copy()
