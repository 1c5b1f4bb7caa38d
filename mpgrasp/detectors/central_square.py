"""Central square of a frame, which all detectors look at, and a test of whether it holds any information.

All detectors share that test, so that an image without information has no grasp, whichever is asked.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpgrasp.depth import CROP, NETWORK_SIZE, DepthFrame, crop_resize
from mpgrasp.grasp import GraspMap

MIN_SIDE = 32
"""Least side of an image that says anything [px]."""
MIN_SEEN = 0.05
"""Least share of pixels with a return; with fewer the image says nothing."""
MIN_RELIEF = 1e-4
"""Least difference between depths; with less the image says nothing [m]."""


def central_square(frame: DepthFrame, crop: int = CROP, size: int = NETWORK_SIZE) -> DepthFrame:
    """Return the frame's central square of `crop` px, or as far as it goes, resized to `size` px.

    A depth that is no distance, such as infinity or zero, is a hole like any other.
    """
    known = np.isfinite(frame.depth) & (frame.depth > 0)
    clean = frame if known.all() else replace(frame, depth=np.where(known, frame.depth, np.float32(np.nan)))
    return crop_resize(clean, min(crop, *frame.depth.shape), size)


def says_something(frame: DepthFrame, image: DepthFrame) -> bool:
    """True if a frame is large enough, and its central square `image` has enough returns and relief."""
    known = np.isfinite(image.depth)
    if min(frame.depth.shape) < MIN_SIDE or known.mean() < MIN_SEEN:
        return False
    return bool(np.nanmax(image.depth) - np.nanmin(image.depth) >= MIN_RELIEF)


def empty_map(image: DepthFrame) -> GraspMap:
    """Return a grasp map without any grasp, of the size of the image."""
    return GraspMap(
        quality=np.zeros_like(image.depth),
        angle=np.zeros_like(image.depth),
        width=np.zeros_like(image.depth),
        depth=image.depth,
        intrinsics=image.intrinsics,
        T_world_camera=image.T_world_camera,
        time=image.time,
    )
