"""A sheet of example pictures from a shard: colour, depth and quality, with the grasps that were lifted."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from mpgrasp.geometry import invert, transform_points
from mpgrasp.grasp import GraspRectangle, peaks, world_to_image_angle
from mpgrasp.training.data.labels import QUALITY_UNIT, decode_angle, decode_depth
from mpgrasp.training.data.verification import TRIAL_COLUMNS
from mpgrasp.training.data.views import META_COLUMNS, stored_intrinsics, stored_pose

EXAMPLES = 12
"""Views on a sheet."""
COLUMNS = 2
"""Views side by side."""
JAW_PX = 14.0
"""Drawn width of the fingers [px]."""
LIFTED, LOST, LABELLED = (80, 220, 80), (60, 60, 255), (255, 220, 120)
"""Colours (BGR) of grasps that lifted, of those that did not, and of the labels' best."""


def write_sheet(shard: Path, path: Path) -> None:
    """Write a PNG of views spread over the shard, as stored.

    A row of a view is its colour, depth and quality. Analytic grasps that were tried are drawn on colour and
    depth, green where they lifted and red where they did not; those the analysis excludes on the depth
    alone, dashed by a dot at their centre. On the quality lie the labels' best grasps.
    """
    with np.load(shard) as arrays:
        n = len(arrays["depth"])
        chosen = np.unique(np.linspace(0, n - 1, min(n, EXAMPLES)).astype(int))
        wanted = [name for name in arrays.files if name != "trials"]
        stored = {name: arrays[name][chosen] for name in wanted}
        trials = arrays["trials"]
    tiles = []
    for k in range(len(chosen)):
        view = {name: value[k] for name, value in stored.items()}
        mine = trials[:, TRIAL_COLUMNS.index("scene")] == view["meta"][META_COLUMNS.index("scene")]
        tiles.append(_tile(view, trials[mine]))
    blank = np.zeros_like(tiles[0])
    tiles += [blank] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    cv2.imwrite(str(path), np.vstack(rows))


def _tile(view: dict[str, np.ndarray], trials: np.ndarray) -> np.ndarray:
    """Draw one view as a BGR picture (H, 3 W, 3); (H, 2 W, 3) without colour."""
    depth_picture = _depth_picture(decode_depth(view["depth"]))
    quality = view["quality"] * np.float32(QUALITY_UNIT)
    quality_picture = _coloured(quality, cv2.COLORMAP_VIRIDIS)
    pictures = [depth_picture, quality_picture]
    if "rgb" in view:
        pictures.insert(0, np.ascontiguousarray(view["rgb"][..., ::-1]))
    angle = decode_angle(view["angle"])
    for row, col in peaks(quality, threshold=0.3, distance=12, count=5):
        rectangle = GraspRectangle(
            u=float(col),
            v=float(row),
            angle=float(angle[row, col]),
            width_px=float(view["width"][row, col]),
            jaw_px=JAW_PX,
        )
        _draw(quality_picture, rectangle, LABELLED)
    for trial in trials:
        told = dict(zip(TRIAL_COLUMNS, trial.astype(float), strict=True))
        rectangle, colour = _rectangle(view["meta"], told), LIFTED if told["lifted"] else LOST
        if not told["positive"]:
            cv2.circle(depth_picture, (round(rectangle.u), round(rectangle.v)), 2, colour, 1)
            _draw(depth_picture, rectangle, colour, jaws=False)
            continue
        for picture in pictures[:-1]:
            _draw(picture, rectangle, colour)
    text = f"z {view['meta'][0]:.2f}  thick {1e3 * view['meta'][2]:.0f} mm  Q {quality.max():.2f}"
    cv2.putText(depth_picture, text, (4, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 255, 255), 1, cv2.LINE_AA)
    tile = np.hstack(pictures)
    return cv2.copyMakeBorder(tile, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(90, 90, 90))


def _rectangle(meta: np.ndarray, told: dict[str, float]) -> GraspRectangle:
    """Return the rectangle of a trial's grasp in a view."""
    T, intrinsics = stored_pose(meta), stored_intrinsics()
    point = transform_points(invert(T), np.array([told["x"], told["y"], told["z"]]))
    u, v = intrinsics.project(point)
    return GraspRectangle(
        u=float(u),
        v=float(v),
        angle=float(world_to_image_angle(told["angle"], T)),
        width_px=told["width"] * intrinsics.fx / float(point[2]),
        jaw_px=JAW_PX,
    )


def _draw(
    picture: np.ndarray, rectangle: GraspRectangle, colour: tuple[int, int, int], *, jaws: bool = True
) -> None:
    """Draw both jaws of a grasp and a thin line between them."""
    a, b, c, d = np.clip(np.rint(rectangle.corners()), -2000, 2000).astype(np.int32).tolist()
    if jaws:
        cv2.line(picture, a, b, colour, 1, cv2.LINE_AA)
        cv2.line(picture, c, d, colour, 1, cv2.LINE_AA)
    left, right = ((np.array([p, q]).sum(axis=0) // 2).tolist() for p, q in ((a, b), (c, d)))
    cv2.line(picture, left, right, tuple(int(0.7 * x) for x in colour), 1, cv2.LINE_AA)


def _depth_picture(depth: np.ndarray) -> np.ndarray:
    known = np.isfinite(depth)
    # a band of 80 mm under the nearest surface, so that a few millimetres show
    near = np.percentile(depth[known], 0.5) if known.any() else 0.0
    far = np.percentile(depth[known], 99.0) if known.any() else 1.0
    grey = np.clip((far - depth) / max(min(far - near, 0.08), 0.01), 0, 1)
    picture = _coloured(np.where(known, grey, 0), cv2.COLORMAP_BONE)
    picture[~known] = (60, 0, 60)
    return picture


def _coloured(values: np.ndarray, colours: int) -> np.ndarray:
    return np.asarray(cv2.applyColorMap((np.clip(values, 0, 1) * 255).astype(np.uint8), colours))
