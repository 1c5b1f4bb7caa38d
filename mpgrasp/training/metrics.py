"""Agreement of a network's best grasp of an image with its labels: densely, and by the rectangle metric.

Neither executes anything. A hit means that a labelled grasp lies where the network would grasp, in its
direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpgrasp.geometry import line_angle_difference
from mpgrasp.grasp import GraspRectangle, best_pixel
from mpgrasp.training.augmentation import Sample
from mpgrasp.training.dataset import GraspDataset

NEAR = 2
"""Distance from the best pixel within which a label counts, along rows and columns [px]."""
MAX_ANGLE = np.deg2rad(30.0)
"""Largest angle between a grasp and a label that agree; also the rectangle metric's [rad]."""
MIN_IOU = 0.25
"""Rectangles overlap by more than this; the rectangle metric's."""
GOOD = 0.5
"""A label is good when it has at least this share of the image's best label quality."""
OPENING = (0.75, 1.5)
"""An opening agrees within these multiples of the label's: narrower hits the object, wider its neighbour."""
SEARCH = 24
"""Labels farther than this from the best pixel are not compared as rectangles [px]."""
JAW_SHARE = 0.5
"""Side of a rectangle, as a share of its opening; the published code's."""


@dataclass(frozen=True, kw_only=True)
class LabelMatch:
    """Agreement of one image's best grasp with the labels."""

    hit: bool
    """A good label within `NEAR`, angle and opening agree."""
    rectangle: bool
    """A good label overlaps by more than `MIN_IOU`, angle agrees."""
    quality: float
    """The network's quality at its best pixel."""
    label_quality: float
    """Best label quality within `NEAR` of it whose angle agrees, 0 where none does."""
    score: float
    """The same where the opening agrees too, as a share of the image's best label."""


def match_labels(
    quality: NDArray[np.float32], angle: NDArray[np.float32], width: NDArray[np.float32], truth: Sample
) -> LabelMatch:
    """Compare the best pixel of maps (H, W), angles [rad], widths [px], with the labels of the image."""
    row, col = best_pixel(quality)
    around = _window(row, col, NEAR, quality.shape)
    theta, opening = float(angle[row, col]), float(width[row, col])
    good = truth.quality >= max(GOOD * float(truth.quality.max()), 1 / 255)
    agrees = line_angle_difference(truth.angle[around], theta) <= MAX_ANGLE
    ratio = opening / np.maximum(truth.width[around], 1e-6)
    fits = (ratio >= OPENING[0]) & (ratio <= OPENING[1])
    labels = truth.quality[around] * agrees
    return LabelMatch(
        hit=bool((good[around] & agrees & fits).any()),
        rectangle=_rectangle_hit(row, col, theta, opening, truth, good),
        quality=float(quality[row, col]),
        label_quality=float(labels.max()),
        score=float((labels * fits).max() / max(float(truth.quality.max()), 1 / 255)),
    )


def _window(row: int, col: int, radius: int, shape: tuple[int, ...]) -> tuple[slice, slice]:
    rows = slice(max(row - radius, 0), min(row + radius + 1, shape[0]))
    return rows, slice(max(col - radius, 0), min(col + radius + 1, shape[1]))


def _rectangle_hit(
    row: int, col: int, theta: float, opening: float, truth: Sample, good: NDArray[np.bool_]
) -> bool:
    window = _window(row, col, SEARCH, good.shape)
    agrees = good[window] & (line_angle_difference(truth.angle[window], theta) < MAX_ANGLE)
    rows, cols = np.nonzero(agrees)
    rows, cols = rows + window[0].start, cols + window[1].start
    mine = _rectangle(row, col, theta, opening)
    # nearest first, and not all of them: neighbouring labels are nearly the same rectangle
    for k in np.argsort(np.hypot(rows - row, cols - col), kind="stable")[:200:4]:
        r, c = int(rows[k]), int(cols[k])
        if mine.iou(_rectangle(r, c, float(truth.angle[r, c]), float(truth.width[r, c]))) > MIN_IOU:
            return True
    return False


def _rectangle(row: int, col: int, theta: float, opening: float) -> GraspRectangle:
    return GraspRectangle(
        u=float(col), v=float(row), angle=theta, width_px=opening, jaw_px=JAW_SHARE * opening
    )


def summarise(
    matches: Mapping[int, LabelMatch],
    graspable: Mapping[int, bool],
    dataset: GraspDataset,
    lifted: Mapping[int, bool] | None = None,
) -> dict[str, float]:
    """Return rates over images with a labelled grasp, for all and by group, and claims where there is none.

    Keys: score, hit, rectangle, label_quality, claimed (mean quality of the best pixel), empty_claimed (the
    same of images without any label), n; lift and n_lift, of the images whose best grasp was executed;
    hit_<group> and n_<group> for thin, thick, low, mid and high cameras.
    """
    images = np.array([i for i in matches if graspable[i]], int)
    empty = [matches[i].quality for i in matches if not graspable[i]]
    summary = {"n": float(len(images)), "n_empty": float(len(empty))}
    if empty:
        summary["empty_claimed"] = float(np.mean(empty))
    if not len(images):
        return summary
    hits = np.array([matches[i].hit for i in images], float)
    summary["score"] = float(np.mean([matches[i].score for i in images]))
    summary["hit"] = float(hits.mean())
    summary["rectangle"] = float(np.mean([matches[i].rectangle for i in images]))
    summary["label_quality"] = float(np.mean([matches[i].label_quality for i in images]))
    summary["claimed"] = float(np.mean([matches[i].quality for i in images]))
    if lifted:
        summary |= {"lift": float(np.mean(list(lifted.values()))), "n_lift": float(len(lifted))}
    for name, members in _groups(dataset).items():
        chosen = members[images]
        if chosen.any():
            summary[f"hit_{name}"] = float(hits[chosen].mean())
            summary[f"n_{name}"] = float(chosen.sum())
    return summary


def _groups(dataset: GraspDataset) -> dict[str, NDArray[np.bool_]]:
    groups: dict[str, NDArray[np.bool_]] = {}
    thin, height = dataset.column("thin"), dataset.column("camera_height")
    if thin is not None:
        groups |= {"thin": thin > 0.5, "thick": thin <= 0.5}
    if height is not None:
        low, high = np.quantile(height, [1 / 3, 2 / 3])
        groups |= {"low": height <= low, "mid": (height > low) & (height <= high), "high": height > high}
    return groups


def format_summary(summary: Mapping[str, float]) -> str:
    """Return the summary in one line."""
    rates = [f"{k} {v:.3f}" for k, v in summary.items() if not k.startswith("n")]
    return "  ".join([f"n {summary.get('n', 0):.0f}", *rates])
