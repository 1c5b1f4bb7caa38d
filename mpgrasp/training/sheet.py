"""A sheet of example pictures from a shard: depth, quality, and the best grasps drawn on the angle map."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from mpgrasp.grasp import GraspRectangle, peaks
from mpgrasp.training.labels import QUALITY_UNIT, decode_angle, decode_depth

EXAMPLES = 20
"""Views on a sheet."""
COLUMNS = 4
"""Views side by side."""
JAW_PX = 14.0
"""Drawn width of the fingers [px]."""


def write_sheet(shard: Path, path: Path) -> None:
    """Write a PNG with depth, quality and angle of views spread over the shard, as stored."""
    with np.load(shard) as arrays:
        n = len(arrays["depth"])
        chosen = np.unique(np.linspace(0, n - 1, min(n, EXAMPLES)).astype(int))
        stored = {name: arrays[name][chosen] for name in ("depth", "quality", "angle", "width", "meta")}
    tiles = [_tile({name: value[k] for name, value in stored.items()}) for k in range(len(chosen))]
    blank = np.zeros_like(tiles[0])
    tiles += [blank] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    cv2.imwrite(str(path), np.vstack(rows))


def _tile(view: dict[str, np.ndarray]) -> np.ndarray:
    """(H, 3 W, 3) BGR picture of one view."""
    depth = decode_depth(view["depth"])
    known = np.isfinite(depth)
    # a band of 80 mm under the nearest surface, so that a few millimetres show
    near = np.percentile(depth[known], 0.5) if known.any() else 0.0
    far = np.percentile(depth[known], 99.0) if known.any() else 1.0
    grey = np.clip((far - depth) / max(min(far - near, 0.08), 0.01), 0, 1)
    depth_picture = _coloured(np.where(known, grey, 0), cv2.COLORMAP_BONE)
    depth_picture[~known] = (60, 0, 60)
    quality = view["quality"] * np.float32(QUALITY_UNIT)
    angle = decode_angle(view["angle"])
    angle_picture = _coloured((angle / np.pi + 0.5), cv2.COLORMAP_HSV)
    angle_picture[quality == 0] = 0
    for k, (row, col) in enumerate(peaks(quality, threshold=0.3, distance=12, count=8)):
        rectangle = GraspRectangle(
            u=float(col),
            v=float(row),
            angle=float(angle[row, col]),
            width_px=float(view["width"][row, col]),
            jaw_px=JAW_PX,
        )
        corners = np.rint(rectangle.corners()).astype(np.int32)
        for picture in (depth_picture, angle_picture):
            cv2.line(picture, corners[0], corners[1], (80, 80, 255) if k == 0 else (80, 200, 80), 1)
            cv2.line(picture, corners[2], corners[3], (80, 80, 255) if k == 0 else (80, 200, 80), 1)
    text = f"z {view['meta'][0]:.2f}  thick {1e3 * view['meta'][2]:.0f} mm  Q {quality.max():.2f}"
    cv2.putText(depth_picture, text, (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 255, 255), 1, cv2.LINE_AA)
    tile = np.hstack([depth_picture, _coloured(quality, cv2.COLORMAP_VIRIDIS), angle_picture])
    return cv2.copyMakeBorder(tile, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(90, 90, 90))


def _coloured(values: np.ndarray, colours: int) -> np.ndarray:
    return np.asarray(cv2.applyColorMap((np.clip(values, 0, 1) * 255).astype(np.uint8), colours))
