"""What a policy sees at a control tick and what it may do: the observations and actions of `mpgrasp.env`."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpgrasp.camera.rasteriser import FAR
from mpgrasp.depth import CROP, DepthFrame, crop_resize
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import GraspMap
from mpgrasp.workspace import WORKSPACE_CENTRE

ACTION_SCALE = (0.1, 0.1, 0.1, 0.5)
"""Motion that an action of 1 stands for: speed along world x, y, z [m/s], yaw rate [rad/s]. MP-PC's bounds,
though it descends at half of the vertical one."""
STEERED = [0, 1, 2, 5]
"""Components of a twist that an action sets."""

Observed = dict[str, NDArray[np.float32]]
"""`depth` (224, 224) [m], the central square, 0 where there was no return; `quality` (224, 224), the
detector's Q on the same pixels; `tcp` (3,) world position [m]; `yaw` (1,) of the tcp's x axis [rad]; `time`
(1,) since the start [s]."""

IMAGE = 84
"""Side of the images of `pictured` [px]: that of the network that learners of policies bring."""
RELIEF = 0.08
"""Height over the image's median that is white in them, and depth below it that is black [m]."""
SLOW = 30.0
"""Time that counts 1 in the state of `pictured` [s]."""

Pictured = dict[str, NDArray[np.uint8] | NDArray[np.float32]]
"""`image` (2, 84, 84), 0 to 255: heights about the image's median, and the detector's Q; `state` (6,): the
tool's x, y from the workspace's centre and z [m], sine and cosine of its yaw, time in units of `SLOW`."""


def observed(frame: DepthFrame, grasp_map: GraspMap, T_world_tcp: FloatArray, time: float) -> Observed:
    """Return what a policy sees of a frame, of what a detector made of it, and of the tool's pose (4, 4).

    Args:
        frame: of this tick.
        grasp_map: made of it.
        T_world_tcp: pose of the tool point.
        time: since the start [s].
    """
    image, depth = observed_depth(frame)
    T = T_world_tcp
    return {
        "depth": depth,
        "quality": _quality_on(image, grasp_map),
        "tcp": T[:3, 3].astype(np.float32),
        "yaw": np.array([np.arctan2(T[1, 0], T[0, 0])], np.float32),
        "time": np.array([time], np.float32),
    }


def observed_depth(frame: DepthFrame) -> tuple[DepthFrame, NDArray[np.float32]]:
    """Return the central square of a frame, and its depth as it is observed."""
    image = crop_resize(frame, min(CROP, *frame.depth.shape))
    return image, _without_nan(np.clip(image.depth, 0.0, FAR))


def pictured(grasp_map: GraspMap, T_world_tcp: FloatArray, time: float) -> Pictured:
    """Return the same as images of bytes and a short vector, made of the detector's map alone.

    Args:
        grasp_map: of this tick.
        T_world_tcp: pose (4, 4) of the tool point.
        time: since the start [s].
    """
    depth = grasp_map.depth
    known = np.isfinite(depth)
    middle = np.float32(np.median(depth[known])) if known.any() else np.float32(0)
    heights = np.where(known, middle - depth, 0).astype(np.float32)
    planes = (0.5 + 0.5 * heights / RELIEF, np.nan_to_num(grasp_map.quality))
    image = [cv2.resize(plane, (IMAGE, IMAGE), interpolation=cv2.INTER_AREA) for plane in planes]
    T = T_world_tcp
    yaw = np.arctan2(T[1, 0], T[0, 0])
    place = T[:3, 3] - (*WORKSPACE_CENTRE, 0.0)
    return {
        "image": np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8),
        "state": np.clip([*place, np.sin(yaw), np.cos(yaw), time / SLOW], -2, 2).astype(np.float32),
    }


def action_of(twist: FloatArray) -> NDArray[np.float32]:
    """Return the action (4,) in [-1, 1] that comes closest to a twist (6,), world axes [m/s, rad/s]."""
    action: NDArray[np.float32] = np.clip(twist[STEERED] / ACTION_SCALE, -1, 1).astype(np.float32)
    return action


def twist_of(action: ArrayLike) -> NDArray[np.float64]:
    """Return the twist (6,), world axes [m/s, rad/s], of an action (4,).

    Raises:
        ConfigError: no four finite numbers.
    """
    action = np.asarray(action, float)
    if action.shape != (len(ACTION_SCALE),) or not np.isfinite(action).all():
        raise ConfigError("unusable action", got=action.tolist(), allowed="4 finite numbers in [-1, 1]")
    twist = np.zeros(6)
    twist[STEERED] = np.clip(action, -1, 1) * ACTION_SCALE
    return twist


def _quality_on(image: DepthFrame, view: GraspMap) -> NDArray[np.float32]:
    """Return the quality on the pixels of `image`, whatever those of the detector; 0 beyond them."""
    to, own = image.intrinsics, view.intrinsics
    quality = _without_nan(np.clip(view.quality, 0.0, 1.0))
    if own != to:
        v, u = np.indices((to.height, to.width)).astype(float)
        at = own.project(to.deproject(u, v, np.ones(u.shape))).astype(np.float32)  # (224, 224, 2)
        quality = np.asarray(cv2.remap(quality, at[..., 0], at[..., 1], cv2.INTER_LINEAR))
    return quality


def _without_nan(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return an image as float32 with 0 where it is NaN; it is changed, if it is float32 already."""
    image = image.astype(np.float32, copy=False)
    image[np.isnan(image)] = 0.0
    return image
