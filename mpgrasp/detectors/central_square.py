"""Central square of a frame, which all detectors look at, and a test of whether it holds any information.

All detectors share that test, so that an image without information has no grasp, whichever is asked.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import CROP, NETWORK_SIZE, DepthFrame, crop_resize
from mpgrasp.grasp import GraspMap

FALSE_MATCH = 0.2
"""A group of pixels nearer than the image's median by more than this may be a false match of stereo [m];
nothing that a Panda's hand takes in rises higher."""
FALSE_SHARE = 0.01
"""It is one if it covers no more than this share of the image."""
MIN_SIDE = 32
"""Least side of an image that says anything [px]."""
MIN_SEEN = 0.05
"""Least share of pixels with a return; with fewer the image says nothing."""
MIN_RELIEF = 1e-4
"""Least difference between depths; with less the image says nothing [m]."""


def central_square(frame: DepthFrame, crop: int = CROP, size: int = NETWORK_SIZE) -> DepthFrame:
    """Return the frame's central square of `crop` px, or as far as it goes, resized to `size` px.

    A depth that is no distance, such as infinity or zero, is a hole like any other, and so is a false match.
    """
    wrong = (frame.depth <= 0) | (frame.depth == np.inf)
    clean = replace(frame, depth=np.where(wrong, np.float32(np.nan), frame.depth)) if wrong.any() else frame
    image = crop_resize(clean, min(crop, *frame.depth.shape), size)
    false = false_matches(image.depth)
    return image if false is None else replace(image, depth=np.where(false, np.float32(np.nan), image.depth))


def false_matches(depth: NDArray[np.float32]) -> NDArray[np.bool_] | None:
    """Return the pixels (H, W) of small groups far nearer than all else; None where there are none.

    Stereo matches what it can where there is nothing to match with, in corners above all. With the holes
    around it filled, such a speck looks like a tower to be grasped: networks claimed it with a quality of 1.

    Args:
        depth: (H, W) z-depth [m], NaN = no return.
    """
    some = depth[::4, ::4]
    some = some[np.isfinite(some)]
    if not some.size:
        return None
    near = depth < np.float32(np.median(some) - FALSE_MATCH)  # NaN is nowhere
    if not near.any():
        return None
    _, labels, stats, _ = cv2.connectedComponentsWithStats(near.astype(np.uint8), connectivity=8)
    small = stats[:, cv2.CC_STAT_AREA] <= FALSE_SHARE * depth.size
    small[0] = False  # everything else
    return np.asarray(small[labels], bool) if small.any() else None


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
