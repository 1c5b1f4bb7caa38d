"""Depth readings as cameras deliver them, the metres that they stand for, and the limits of a depth image.

Cameras differ in the type and unit of a reading and in the mark of a pixel without a return:

| camera | type | unit [m] | no return |
|---|---|---|---|
| Intel RealSense, Z16 | uint16 | `get_depth_scale()`: 0.001 (D400), 0.00025 (L515) | 0 |
| Azure Kinect, DEPTH16 | uint16 | 0.001 | 0 |
| ROS image 16UC1 | uint16 | 0.001 | 0 |
| ROS image 32FC1 (REP 117, 118) | float32 | 1 | NaN, inf, -inf |
| Zivid, Z of the point cloud | float32 | 0.001 | NaN |
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError

MIN_DEPTH = 0.005
"""Less than this in a whole image is no distance of a camera: the unit is wrong [m]."""
MAX_DEPTH = 10.0
"""Reach of the cameras that grasping is done with; a hundredth of the millimetres of a near surface [m]."""

_REMEDY = "metres, NaN = no return; DepthFrame.from_camera(depth, unit=..., no_return=...) takes all others"


def check_depth(depth: object, shape: tuple[int, int]) -> None:
    """Raise ConfigError unless `depth` is a float32 image (H, W) in metres, NaN where there is no return.

    An image of NaN alone is allowed. It takes two passes over the image.
    """
    if not isinstance(depth, np.ndarray):
        raise ConfigError("a depth image that is no numpy array", got=type(depth).__name__, allowed=_REMEDY)
    if depth.shape != shape:
        raise ConfigError(
            "depth image and intrinsics disagree in size", got=depth.shape, allowed=f"(H, W) = {shape}"
        )
    if depth.dtype != np.float32:
        raise ConfigError("a depth image of the wrong type", got=_words(depth), allowed=f"float32 {_REMEDY}")
    nearest, farthest = np.fmin.reduce(depth, axis=None), np.fmax.reduce(depth, axis=None)
    if nearest <= 0 or farthest > MAX_DEPTH or farthest < MIN_DEPTH:  # all False where there is only NaN
        raise ConfigError(_wrong_range(nearest, farthest), got=_words(depth), allowed=_REMEDY)


def metres(depth: object, unit: float, no_return: float | Iterable[float]) -> NDArray[np.float32]:
    """Return a camera's readings (H, W) in metres, NaN where there was no return; see the table above.

    Single readings beyond `MAX_DEPTH` are false matches, and no returns either.

    Args:
        depth: image of integers of 16 bits or more, or of floats; NaN is always without a return.
        unit: length that a reading of 1 stands for [m].
        no_return: reading, or readings, of a pixel without a return.

    Raises:
        ConfigError: no such image, a unit that it cannot have, or readings that are no distance.
    """
    if not isinstance(depth, np.ndarray) or depth.ndim != 2 or not depth.size:
        got = _words(depth) if isinstance(depth, np.ndarray) else type(depth).__name__
        raise ConfigError("readings that are no depth image", got=got, allowed="a numpy array (H, W)")
    whole = np.issubdtype(depth.dtype, np.integer)
    if not (np.issubdtype(depth.dtype, np.floating) or (whole and depth.dtype.itemsize > 1)):
        raise ConfigError(
            "readings of the wrong type", got=_words(depth), allowed="integers of 16 bits or more, floats"
        )
    if not (isinstance(unit, int | float) and 0 < unit <= 1) or (whole and unit == 1):
        allowed = "0.001 for millimetres" if whole else "1 for metres, 0.001 for millimetres"
        raise ConfigError(f"unusable unit of {depth.dtype} readings [m]", got=unit, allowed=allowed)
    lost = np.isnan(depth)
    for mark in _marks(no_return):
        lost |= depth == mark
    result = (depth * np.float64(unit)).astype(np.float32)
    result[lost] = np.nan
    beyond = (result > MAX_DEPTH) & np.isfinite(result)
    if 2 * beyond.sum() < (~lost).sum():  # else it is the unit that is wrong
        result[beyond] = np.nan
    nearest, farthest = np.fmin.reduce(result, axis=None), np.fmax.reduce(result, axis=None)
    if nearest <= 0 or farthest > MAX_DEPTH or farthest < MIN_DEPTH:
        raise ConfigError(
            _wrong_range(nearest, farthest),
            got=f"{_words(depth)}, unit {unit:g} m, no_return {no_return}",
            allowed=f"up to {MAX_DEPTH:g} m; whatever marks a pixel without a return in no_return",
        )
    return result


def check_colour(rgb: object, shape: tuple[int, int]) -> None:
    """Raise ConfigError unless `rgb` is a uint8 image (H, W, 3) of the depth image's size (H, W)."""
    fits = isinstance(rgb, np.ndarray) and rgb.dtype == np.uint8 and rgb.shape == (*shape, 3)
    if not fits:
        got = f"{rgb.dtype} {rgb.shape}" if isinstance(rgb, np.ndarray) else type(rgb).__name__
        raise ConfigError("an unusable colour image", got=got, allowed=f"uint8 (H, W, 3) = {(*shape, 3)}")


def _marks(no_return: float | Iterable[float]) -> list[float]:
    marks = list(no_return) if isinstance(no_return, Iterable) else [no_return]
    if not all(isinstance(mark, int | float | np.number) for mark in marks):
        raise ConfigError(
            "unusable marks of no return", got=no_return, allowed="numbers, such as 0 or (0, 65535)"
        )
    return marks


def _wrong_range(nearest: float, farthest: float) -> str:
    """Return what is wrong with an image whose readings lie between these depths [m]."""
    if nearest < 0:
        return "a depth below zero"
    if nearest == 0:
        return "a depth of 0 m, which many cameras report where there is no return"
    if np.isinf(farthest):
        return "an infinite depth, which many cameras report where there is no return"
    if farthest < MIN_DEPTH:
        return f"a depth image that ends at {farthest:.3g} m: its unit is too small"
    return f"a depth of {farthest:g} m, which looks like millimetres"


def _words(depth: NDArray[np.generic]) -> str:
    """Return type, size and range of an image in a few words: "uint16 (480, 640) from 0 to 1203"."""
    text = f"{depth.dtype} {depth.shape}"
    if depth.dtype.kind not in "iuf" or not depth.size:
        return text
    known = depth[~np.isnan(depth)]
    return f"{text} from {known.min():g} to {known.max():g}" if known.size else f"{text}, all NaN"
