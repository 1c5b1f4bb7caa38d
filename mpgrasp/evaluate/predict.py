"""Grasps of a detector in an image of a dataset, as the closed loop would ask for them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mpgrasp.datasets.labelled_image import LabelledImage, window
from mpgrasp.datasets.levelling import level
from mpgrasp.depth import CROP, CameraIntrinsics, DepthFrame
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.geometry import looking_down
from mpgrasp.grasp import GraspMap, GraspRectangle, peaks

PEAK_DISTANCE = 20.0
"""Distance between two grasps of one image [px of the map]; published code's."""
PEAK_THRESHOLD = 0.2
"""Quality from which there is another grasp than the best; published code's."""
JAW_SHARE = 0.5
"""Side of a rectangle as a share of its opening; published code's."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Square:
    """The square of an image that detectors see, and where it lies."""

    image: LabelledImage
    """The square, with the labels in its pixels."""
    centre: tuple[float, float]
    """(u, v) of its middle in the whole image [px]."""
    side: float
    """Its side in pixels of the whole image [px]."""

    def back(self, grasp: GraspRectangle) -> GraspRectangle:
        """Return a grasp of the square in pixels of the whole image."""
        size = self.image.depth.shape[0]
        scale = self.side / size
        u, v = (
            middle + (at - (size - 1) / 2) * scale
            for middle, at in zip(self.centre, (grasp.u, grasp.v), strict=True)
        )
        return replace(grasp, u=u, v=v, width_px=grasp.width_px * scale, jaw_px=grasp.jaw_px * scale)


def square(
    image: LabelledImage, side: float | None = None, size: int | None = None, *, levelled: bool = False
) -> Square:
    """Return the square of an image that detectors see.

    Args:
        image: of the dataset.
        side: of the square around the labels, kept within the image [px]; None for the largest in the
            image's middle.
        size: of the result [px]; None for as many pixels as there are, up to `CROP`.
        levelled: True if the table is levelled.
    """
    height, width = image.depth.shape
    whole = min(height, width)
    if side is None:
        centre, side = ((width - 1) / 2, (height - 1) / 2), float(whole)
    else:
        side = min(side, float(whole))
        u, v = image.centre_of_labels
        low, high = (side - 1) / 2, -(side + 1) / 2
        centre = (float(np.clip(u, low, width + high)), float(np.clip(v, low, height + high)))
    seen = window(image, centre, side, min(round(side), CROP) if size is None else size)
    return Square(image=level(seen) if levelled else seen, centre=centre, side=float(side))


def grasps(found: GraspMap, size: int, count: int) -> list[GraspRectangle]:
    """Return the best grasps of a grasp map, best first, in pixels of the square image that it is of.

    The first one is the best pixel; others are maxima above `PEAK_THRESHOLD`, `PEAK_DISTANCE` apart.

    Args:
        found: what a detector made of the image.
        size: side of the image [px].
        count: number of grasps at most.
    """
    scale = size / found.quality.shape[0]
    places = peaks(found.quality, threshold=PEAK_THRESHOLD, distance=PEAK_DISTANCE, count=count)
    if not len(places):
        places = np.array([np.unravel_index(int(np.argmax(found.quality)), found.quality.shape)])
    rectangles = []
    for row, col in places[:count]:
        opening = float(found.width[row, col]) * scale
        rectangles.append(
            GraspRectangle(
                u=(float(col) + 0.5) * scale - 0.5,
                v=(float(row) + 0.5) * scale - 0.5,
                angle=float(found.angle[row, col]),
                width_px=opening,
                jaw_px=JAW_SHARE * opening,
            )
        )
    return rectangles


def predict(detector: GraspDetector, image: LabelledImage) -> GraspMap:
    """Return the grasp map of a detector for a square image."""
    size, focal = image.depth.shape[0], image.focal_px
    middle = (size - 1) / 2
    frame = DepthFrame(
        depth=image.depth,
        intrinsics=CameraIntrinsics(fx=focal, fy=focal, cx=middle, cy=middle, width=size, height=size),
        T_world_camera=looking_down([0.5, 0.0, 1.0]),
        rgb=image.rgb,
    )
    detector.reset(None)
    return detector.predict(frame)
