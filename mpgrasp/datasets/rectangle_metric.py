"""The rectangle metric (Jiang, Moseson and Saxena, ICRA 2011): overlap above 25 %, angle below 30 degrees."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mpgrasp.geometry import line_angle_difference
from mpgrasp.grasp import GraspRectangle

MIN_IOU = 0.25
"""Intersection over union above which two rectangles overlap enough."""
MAX_ANGLE = math.radians(30.0)
"""Angle below which they agree [rad]; half a turn is none."""


def agree(found: GraspRectangle, label: GraspRectangle) -> bool:
    """True if a grasp is right by one label. Rectangles without an area, or not finite, agree with none."""
    numbers = (found.u, found.v, found.angle, found.width_px, found.jaw_px)
    if not np.isfinite(numbers).all():
        return False
    apart = float(line_angle_difference(found.angle, label.angle))
    return apart < MAX_ANGLE and found.iou(label) > MIN_IOU


def right(found: Sequence[GraspRectangle], labels: Sequence[GraspRectangle]) -> bool:
    """True if one of these grasps is right by one of the labels."""
    return any(agree(grasp, label) for grasp in found for label in _near(grasp, labels))


def best_iou(found: GraspRectangle, labels: Sequence[GraspRectangle]) -> float:
    """Return the greatest overlap with a label whose angle agrees; 0 where none does."""
    overlaps = (
        found.iou(label)
        for label in labels
        if float(line_angle_difference(found.angle, label.angle)) < MAX_ANGLE
    )
    return max(overlaps, default=0.0)


def _near(grasp: GraspRectangle, labels: Sequence[GraspRectangle]) -> list[GraspRectangle]:
    """Labels that a grasp can overlap at all, by the circles around both."""
    radius = math.hypot(grasp.width_px, grasp.jaw_px) / 2
    return [
        label
        for label in labels
        if math.hypot(grasp.u - label.u, grasp.v - label.v)
        <= radius + math.hypot(label.width_px, label.jaw_px) / 2
    ]
