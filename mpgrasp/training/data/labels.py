"""Training labels of one view: the scene's dense grasps as the camera's 224 x 224 image shows them.

Quality is the analysis's graded one, not a rectangle of ones around each grasp: it rises towards the best
grasp of every object, so that a network's highest pixel is its best grasp, and it stays high over what
else would do. Angles and widths are regressed as images where quality is positive.

Labels come from the true depth; the sensor's noise is in the network's input alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.antipodal.analysis import WorldGrasps
from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.detectors.oracle import grasps_in_view

LABEL_HAND = HandGeometry(margin=(0.005, 0.014), min_depth=0.0004, depth_range=0.0012)
"""The hand of the labels. It opens with room, where there is room: where a grasp is and where the camera
believes it to be differ by millimetres. Contacts as low as on a stick of 1 mm count; lifts correct them."""
DEPTH_UNIT = 5e-5
"""Step of stored depths [m]."""
QUALITY_UNIT = 1 / 255
"""Step of stored qualities."""
ANGLE_UNIT = np.pi / 256
"""Step of stored angles, from -pi/2 up [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewLabels:
    """Answer that a network shall give to one image, as it is stored."""

    quality: NDArray[np.uint8]
    """(H, W) in steps of `QUALITY_UNIT`."""
    angle: NDArray[np.uint8]
    """(H, W) closing direction in the image in steps of `ANGLE_UNIT` from -pi/2; 128 (zero) where none is."""
    width: NDArray[np.uint8]
    """(H, W) opening [px]; 0 where there is none."""
    object_mask: NDArray[np.uint8]
    """(H, W) 1 on objects."""


def view_labels(grasps: WorldGrasps, image: DepthFrame) -> ViewLabels:
    """Return the labels of a view, from its true depth at the network's resolution."""
    view = grasps_in_view(grasps, image)
    points = image.world_points()
    row, col, inside = grasps.height_map.cells(points[..., 0], points[..., 1])
    return ViewLabels(
        quality=np.rint(np.clip(view.quality, 0, 1) / QUALITY_UNIT).astype(np.uint8),
        angle=encode_angle(view.angle),
        width=np.clip(np.rint(view.width), 0, 255).astype(np.uint8),
        object_mask=(inside & (grasps.height_map.label[row, col] > 0)).astype(np.uint8),
    )


def without(labels: ViewLabels, spoilt: NDArray[np.bool_]) -> ViewLabels:
    """Return the labels without the grasps at pixels (H, W) whose depth is not believed."""
    return replace(
        labels,
        quality=np.where(spoilt, np.uint8(0), labels.quality),
        angle=np.where(spoilt, np.uint8(128), labels.angle),
        width=np.where(spoilt, np.uint8(0), labels.width),
    )


def encode_angle(angle: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return bins of `ANGLE_UNIT` over [-pi/2, pi/2); above the last comes the first, half a turn on."""
    return (np.rint((np.asarray(angle, float) + np.pi / 2) / ANGLE_UNIT).astype(int) % 256).astype(np.uint8)


def decode_angle(bins: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the angles [rad] of bins."""
    return (bins.astype(np.float32) * np.float32(ANGLE_UNIT) - np.float32(np.pi / 2)).astype(np.float32)


def encode_depth(depth: NDArray[np.floating]) -> NDArray[np.uint16]:
    """Return steps of `DEPTH_UNIT`; 0 = no return, as is anything beyond what 16 bits hold (3.28 m)."""
    steps = np.rint(np.nan_to_num(depth, nan=0.0) / DEPTH_UNIT)
    return np.where((steps > 0) & (steps < 65536), steps, 0).astype(np.uint16)


def decode_depth(steps: NDArray[np.uint16]) -> NDArray[np.float32]:
    """Return depth [m]; NaN where there was no return."""
    return np.where(steps > 0, steps * np.float32(DEPTH_UNIT), np.float32(np.nan)).astype(np.float32)
