"""An image with labelled grasps, and windows of it that turn, zoom and crop the labels along."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, wrap_half_pi
from mpgrasp.grasp import GraspRectangle

_SEEN = 0.5  # weight of pixels with a return from which a new pixel has one


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledImage:
    """One image of a dataset."""

    name: str
    object: str
    """What is on it, so that splits by object are possible."""
    depth: NDArray[np.float32]
    """(H, W) z-depth [m], NaN = no return."""
    rgb: NDArray[np.uint8] | None
    """(H, W, 3), where the dataset has colour."""
    rectangles: tuple[GraspRectangle, ...]
    """Labelled grasps, in pixels of this image."""
    focal_px: float
    """Focal length of the camera, by which pixels become metres [px]."""
    unit: str = "m"
    """Unit in which the depth was stored, which was found out."""

    def __post_init__(self) -> None:
        if self.rgb is not None and self.rgb.shape != (*self.depth.shape, 3):
            raise ConfigError(
                f"{self.name}: colour and depth differ in size", got=self.rgb.shape, allowed=self.depth.shape
            )

    @property
    def centre_of_labels(self) -> tuple[float, float]:
        """Mean (u, v) of the labels' centres [px]; the image's centre without labels."""
        if not self.rectangles:
            height, width = self.depth.shape
            return (width - 1) / 2, (height - 1) / 2
        u, v = np.mean([(r.u, r.v) for r in self.rectangles], axis=0)
        return float(u), float(v)


def window(
    image: LabelledImage, centre: tuple[float, float], side: float, size: int, turn: float = 0.0
) -> LabelledImage:
    """Return a square window of an image, turned and scaled, with its labels.

    Args:
        image: that it is cut from; what lies beyond it has no depth and is black.
        centre: (u, v) of the window [px].
        side: of the window [px of the image].
        size: of the result [px].
        turn: angle by which what is seen turns, counter-clockwise as one looks at it [rad].

    Raises:
        ConfigError: a side or a size that is no window.
    """
    if not (side > 0 and size >= 1):
        raise ConfigError("unusable window", got=(side, size), allowed="a side above 0, a size from 1 [px]")
    to_image = affine(centre, side, size, turn)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    known = np.isfinite(image.depth)
    # a hole, or what lies beyond the image, has no weight: it neither spreads nor mixes with what was seen
    total, weight = (
        cv2.warpAffine(plane, to_image, (size, size), flags=flags)
        for plane in (np.where(known, image.depth, 0).astype(np.float32), known.astype(np.float32))
    )
    depth = np.where(weight > _SEEN, total / np.maximum(weight, np.float32(_SEEN)), np.float32(np.nan))
    rgb = None if image.rgb is None else cv2.warpAffine(image.rgb, to_image, (size, size), flags=flags)
    to_window = np.asarray(cv2.invertAffineTransform(to_image), float)
    moved = tuple(_moved(r, to_window, turn, size / side) for r in image.rectangles)
    return replace(
        image,
        depth=np.asarray(depth, np.float32),
        rgb=None if rgb is None else np.asarray(rgb, np.uint8),
        rectangles=moved,
        focal_px=image.focal_px * size / side,
    )


def affine(centre: tuple[float, float], side: float, size: int, turn: float) -> FloatArray:
    """Return the map (2, 3) from a window's pixels (u, v, 1) to the image's; outer edges meet outer edges."""
    scale, (cos, sin) = side / size, (np.cos(turn), np.sin(turn))
    # what is seen turns counter-clockwise on screen, where v points down
    linear = scale * np.array([[cos, -sin], [sin, cos]])
    middle = np.full(2, (size - 1) / 2)
    return np.column_stack([linear, np.array(centre) - linear @ middle])


def _moved(rectangle: GraspRectangle, to_window: FloatArray, turn: float, scale: float) -> GraspRectangle:
    u, v = np.asarray(to_window, float) @ np.array([rectangle.u, rectangle.v, 1.0])
    return GraspRectangle(
        u=float(u),
        v=float(v),
        angle=float(wrap_half_pi(rectangle.angle + turn)),
        width_px=rectangle.width_px * scale,
        jaw_px=rectangle.jaw_px * scale,
    )
