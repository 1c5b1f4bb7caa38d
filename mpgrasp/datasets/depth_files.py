"""Depth images of datasets: TIFF and PNG files in whatever unit, and Cornell's point clouds."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.datasets.reader import BrokenImageError
from mpgrasp.files.regular import read_regular
from mpgrasp.readings import MAX_DEPTH, metres

LARGEST = 200.0
"""Largest file that is read [MB]."""
CORNELL_SHAPE = (480, 640)
"""Pixels of Cornell's camera."""
_MILLIMETRE = 0.001


def read_image(path: Path, flags: int = cv2.IMREAD_UNCHANGED) -> NDArray[np.generic]:
    """Return an image as it is stored.

    Raises:
        BrokenImageError: it is missing or cannot be read.
    """
    try:
        content = np.frombuffer(read_regular(path, LARGEST), np.uint8)
    except OSError as error:
        raise BrokenImageError(f"{path.name}: {error.strerror}") from error
    image = cv2.imdecode(content, flags) if content.size else None
    if image is None:
        raise BrokenImageError(f"{path.name}: no whole image")
    return np.asarray(image)


def read_rgb(path: Path) -> NDArray[np.uint8]:
    """Return a colour image (H, W, 3).

    Raises:
        BrokenImageError: it is missing or cannot be read.
    """
    return np.asarray(read_image(path, cv2.IMREAD_COLOR)[..., ::-1], np.uint8).copy()


def read_depth(path: Path) -> tuple[NDArray[np.float32], str]:
    """Return a depth image (H, W) [m], NaN where there was no return, and the unit that it was stored in.

    Zero and less, and what is not finite, is no return. The unit is millimetres if the readings are whole
    numbers, or if half of them lie beyond the reach of any camera in metres.

    Raises:
        BrokenImageError: it is missing, no depth image, or has no return at all.
    """
    return _in_metres(path, read_image(path))


def read_depth_array(path: Path) -> tuple[NDArray[np.float32], str]:
    """Return the depth image in a .npy file, like `read_depth`.

    Raises:
        BrokenImageError: it is missing, no depth image, or has no return at all.
    """
    try:
        return _in_metres(path, np.load(io.BytesIO(read_regular(path, LARGEST)), allow_pickle=False))
    except OSError as error:
        raise BrokenImageError(f"{path.name}: {error.strerror}") from error
    except (ValueError, EOFError) as error:
        raise BrokenImageError(f"{path.name}: no array of numbers ({error})") from error


def _in_metres(path: Path, image: NDArray[np.generic]) -> tuple[NDArray[np.float32], str]:
    if image.ndim != 2 or image.dtype.kind not in "uif":
        raise BrokenImageError(f"{path.name}: no depth image, {image.dtype} {image.shape}")
    values = image.astype(np.float32)
    returned = values[np.isfinite(values) & (values > 0)]
    if not returned.size:
        raise BrokenImageError(f"{path.name}: no pixel has a depth")
    whole = image.dtype.kind in "ui" or float(np.median(returned)) > MAX_DEPTH
    unit = _MILLIMETRE if whole else 1.0
    clean = np.where(np.isfinite(values) & (values > 0), values, np.float32(np.nan))
    return metres(clean, unit, ()), "mm" if whole else "m"


def read_point_cloud(path: Path) -> NDArray[np.float32]:
    """Return the depth (480, 640) [m] of a point cloud of Cornell's, NaN where it has no point.

    Its lines are x y z [mm], a colour and the number of the pixel. Depth is the distance from the camera, as
    in the published GG-CNN code, with which networks for Cornell were trained.

    Raises:
        BrokenImageError: it is missing or no such file.
    """
    try:
        text = read_regular(path, LARGEST).decode("ascii", errors="replace")
    except OSError as error:
        raise BrokenImageError(f"{path.name}: {error.strerror}") from error
    head, _, body = text.partition("DATA ascii\n")
    try:
        numbers = np.array([line.split() for line in body.splitlines() if line.strip()], float)
    except ValueError as error:
        raise BrokenImageError(f"{path.name}: no whole point cloud ({error})") from error
    if not head or numbers.ndim != 2 or numbers.shape[1] != 5:
        raise BrokenImageError(f"{path.name}: no point cloud of x y z rgb index")
    index = numbers[:, 4].astype(int)
    depth = np.full(CORNELL_SHAPE, np.nan, np.float32)
    if not ((index >= 0) & (index < depth.size)).all():
        raise BrokenImageError(f"{path.name}: points beside the image of {CORNELL_SHAPE} pixels")
    depth.flat[index] = np.linalg.norm(numbers[:, :3], axis=1) * _MILLIMETRE
    depth[~((depth > 0) & (depth <= MAX_DEPTH))] = np.nan
    return depth
