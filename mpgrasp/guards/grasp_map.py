"""Guard of the detectors: a grasp map in the units and within the ranges of `GraspMap`, or an error.

It takes a few passes over maps that are small beside the image that they were made of.
"""

from __future__ import annotations

import math

import numpy as np

from mpgrasp.depth import DepthFrame
from mpgrasp.exceptions import PlugInError
from mpgrasp.grasp import GraspMap
from mpgrasp.guards.words import TENSOR_REMEDY, described, is_tensor
from mpgrasp.readings import MAX_DEPTH

ROUNDING = 1e-4
"""Beyond its range by less than this is a range met: single precision, and blurred maps."""
WIDEST = 4.0
"""An opening wider than so many times the longer side of its image is in no pixels; what width a network's
output stands for has the same bound."""
CLAIM = 0.3
"""From this quality on a map claims a grasp somewhere, whose opening must make sense."""
SAME_POSE = 1e-6
"""Most that a map's camera pose may differ from the frame's, in any element [m, or a cosine]."""

_TYPES = (np.dtype(np.float32), np.dtype(np.float64))


def check_grasp_map(value: object, frame: DepthFrame, owner: str) -> GraspMap:
    """Return what a detector made of a frame, once it is known to be a usable grasp map.

    Args:
        value: what `predict` returned.
        frame: what it was given.
        owner: who returned it, such as "detector mine".

    Raises:
        PlugInError: no grasp map, or one whose arrays are of another type or unit, out of range or not
            finite, or whose camera is not that of the frame.
    """
    if not isinstance(value, GraspMap):
        raise PlugInError(
            f"{owner}: predict returned no GraspMap", got=described(value), allowed=_form(value)
        )
    for name in ("quality", "angle", "width", "depth"):
        array = getattr(value, name)
        if not isinstance(array, np.ndarray) or array.dtype not in _TYPES:
            raise _wrong(owner, name, "is of the wrong type", array, _types(array))
    pose = np.asarray(value.T_world_camera)
    if not np.array_equal(pose, frame.T_world_camera) and (
        float(np.abs(pose - frame.T_world_camera).max()) > SAME_POSE
    ):
        raise PlugInError(
            f"{owner}: the map's T_world_camera is not the frame's",
            got=[round(float(x), 4) for x in pose[:3, 3]],
            allowed=f"frame.T_world_camera, at {[round(float(x), 4) for x in frame.T_world_camera[:3, 3]]}",
        )
    _check_quality(value, owner)
    _check_angle(value, owner)
    _check_width(value, owner)
    _check_depth(value, owner)
    return value


def _check_quality(grasps: GraspMap, owner: str) -> None:
    low, high = _bounds(grasps.quality)
    if low >= -ROUNDING and high <= 1 + ROUNDING:  # False for NaN
        return
    hint = ""
    if low < 0:
        hint = "; looks like logits: apply the sigmoid" if low < -1 or high > 1 else "; clip it"
    elif 1 < high <= 1.5:
        hint = "; clip it"
    elif 100 < high <= 255:
        hint = "; looks like 0-255: divide by 255"
    elif 1.5 < high <= 100:
        hint = "; looks like per cent, or like logits"
    raise _out_of_range(owner, "quality", grasps.quality, f"0 to 1, 0 where nothing is seen{hint}")


def _check_angle(grasps: GraspMap, owner: str) -> None:
    low, high = _bounds(grasps.angle)
    if low >= -math.pi / 2 - ROUNDING and high <= math.pi / 2 + ROUNDING:
        return
    largest, hint = max(abs(low), abs(high)), ""
    if math.pi + ROUNDING < largest <= 360:
        hint = "; looks like degrees: numpy.deg2rad"
    elif largest <= math.pi + ROUNDING:
        hint = "; mpgrasp.geometry.wrap_half_pi folds it, since half a turn is the same grasp"
    raise _out_of_range(owner, "angle", grasps.angle, f"-pi/2 to pi/2 [rad]{hint}")


def _check_width(grasps: GraspMap, owner: str) -> None:
    low, high = _bounds(grasps.width)
    widest = WIDEST * max(grasps.width.shape)
    if not (low >= -ROUNDING and high <= widest):
        hint = "; no opening is negative: clip it at 0" if low < 0 else ""
        raise _out_of_range(owner, "width", grasps.width, f"0 to {widest:g} [px of this map]{hint}")
    if 0 < high < 1 and float(grasps.quality.max()) > CLAIM:
        raise _wrong(
            owner,
            "width",
            "has no opening of a whole pixel beside a quality that claims a grasp",
            grasps.width,
            "pixels of this map; looks like metres: times intrinsics.fx / depth",
        )


def _check_depth(grasps: GraspMap, owner: str) -> None:
    depth = grasps.depth
    low, high = _bounds(depth)
    if low > 0 and high <= MAX_DEPTH:
        return
    known = ~np.isnan(depth)
    low, high = _bounds(depth[known]) if known.any() else (MAX_DEPTH, MAX_DEPTH)
    if not (low > 0 and high <= MAX_DEPTH):
        hint = "; looks like millimetres" if high > 100 else ""
        raise _out_of_range(
            owner, "depth", depth, f"above 0, up to {MAX_DEPTH:g} [m], NaN where nothing is known{hint}"
        )
    if (grasps.quality[~known] > 0).any():
        raise _wrong(
            owner, "depth", "is NaN where the quality claims a grasp", depth, "a depth, or quality 0"
        )


def _bounds(array: np.ndarray) -> tuple[float, float]:
    """Return the least and the greatest value; NaN if any is."""
    return float(array.min()), float(array.max())


def _out_of_range(owner: str, name: str, array: np.ndarray, allowed: str) -> PlugInError:
    fits = bool(np.isfinite(array).all())
    return _wrong(owner, name, "is out of range" if fits else "is not finite", array, allowed)


def _wrong(owner: str, name: str, what: str, value: object, allowed: str) -> PlugInError:
    return PlugInError(f"{owner}: the map's {name} {what}", got=described(value), allowed=allowed)


def _types(value: object) -> str:
    if is_tensor(value):
        return TENSOR_REMEDY
    if isinstance(value, np.ndarray) and value.dtype == np.uint8:
        return "float32 or float64; looks like 0-255: divide by 255"
    return "a numpy array of float32 or float64"


def _form(value: object) -> str:
    if is_tensor(value):
        return f"GraspMap(quality=..., angle=..., width=..., ...), each {TENSOR_REMEDY}"
    if type(value).__name__ == "coroutine":
        return "a GraspMap; predict must be no `async def`"
    return "GraspMap(quality=..., angle=..., width=..., depth=..., intrinsics=..., T_world_camera=...)"
