"""The floor: a detector that nobody trained, which every network must beat to have learned anything.

What stands out of the median depth by more than the noise is an object; each connected piece is grasped at
its middle, across the short side of the smallest rectangle around it. It is written as a plug-in would be,
and needs OpenCV alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import DepthFrame, inpaint
from mpgrasp.detectors.central_square import central_square, empty_map, says_something
from mpgrasp.detectors.config import HeuristicConfig
from mpgrasp.geometry import wrap_half_pi
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap
from mpgrasp.robot import hand

_MAD = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


class _Piece(NamedTuple):
    """Something that stands out."""

    mask: NDArray[np.bool_]
    """(H, W)"""
    centre: tuple[float, float]
    """u, v [px]."""
    angle: float
    """Direction of the short side in the image [rad], counter-clockwise as one looks at it."""
    short: float
    long: float
    """Sides of the smallest rectangle around it [px]."""


class HeuristicDetector:
    """Median plane, connected pieces, smallest rectangles.

    Args:
        config: how much stands out.
    """

    name = "heuristic"

    def __init__(self, config: HeuristicConfig | None = None) -> None:
        self.config = config or HeuristicConfig()

    def reset(self, truth: HeightMap | None) -> None:
        """Start an episode; nothing is kept from one frame to the next."""

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Return the grasp of every piece that stands out in the frame's central square."""
        image = central_square(frame, self.config.crop)
        measured, depth = np.isfinite(image.depth), inpaint(image.depth)
        result = replace(empty_map(replace(image, depth=depth)), measured=measured)
        if not says_something(frame, image):
            return result
        smooth = cv2.medianBlur(depth, 5)
        relief = np.median(smooth) - smooth
        noise = _MAD * float(np.median(np.abs(relief)))
        outstanding = relief > max(self.config.min_height, self.config.deviations * noise)
        for piece in self._pieces(outstanding):
            px_per_metre = image.intrinsics.fx / float(np.median(depth[piece.mask]))
            opening = piece.short / px_per_metre + 2 * self.config.clearance
            if piece.short / px_per_metre >= hand.GRIPPER_MAX_WIDTH:
                continue
            height = float(relief[piece.mask].mean())
            v, u = np.nonzero(piece.mask)
            distance = np.hypot(u - piece.centre[0], v - piece.centre[1]) / max(piece.long, 1.0)
            sure = height / (height + 2 * noise)
            result.quality[piece.mask] = sure * np.clip(1 - distance, 0, 1)
            result.angle[piece.mask] = piece.angle
            result.width[piece.mask] = min(opening, hand.GRIPPER_MAX_WIDTH) * px_per_metre
        return result

    def _pieces(self, outstanding: NDArray[np.bool_]) -> list[_Piece]:
        """Return the connected pieces that are large enough."""
        number, labels, about, _ = cv2.connectedComponentsWithStats(outstanding.astype(np.uint8))
        pieces = []
        for k in range(1, number):
            if about[k, cv2.CC_STAT_AREA] < self.config.min_area:
                continue
            mask = labels == k
            v, u = np.nonzero(mask)
            centre, (width, height), turn = cv2.minAreaRect(np.column_stack([u, v]).astype(np.float32))
            # OpenCV turns the side `width` by `turn` clockwise as one looks at the image
            angle = -np.deg2rad(turn) + (0 if width <= height else np.pi / 2)
            short, long = sorted((width + 1, height + 1))  # from the outer edges of the pixels
            pieces.append(_Piece(mask, (centre[0], centre[1]), float(wrap_half_pi(angle)), short, long))
        return pieces
