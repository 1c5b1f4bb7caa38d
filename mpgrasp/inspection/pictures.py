"""Pictures of what detectors make of one depth image, side by side, as in the paper's Figs. 4, 7 and 12.

A column per detector; from the top: its input, Q, the opening W, the angle Theta, and the best rectangles
after non-maximum suppression in Fig. 7's order of colours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from mpgrasp.depth import DepthFrame
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, GraspMap, GraspRectangle, best_pixel, peaks
from mpgrasp.recording.false_colour import Picture, shade, shade_depth, shade_lines

RECTANGLES = 5
"""Grasps that are drawn at most."""
DISTANCE = 20.0
"""Distance of two peaks below which only the better one is drawn [px of the grasp map]."""
THRESHOLD = 0.1
"""Peaks of Q up to this are not drawn."""
OPENING = 0.08
"""Opening at the bright end of the scale, the most that the Panda's hand can [m]."""

_SIDE = 300  # [px], of a panel
_GAP = 6  # [px]
_MARGIN, _HEAD = 118, 86  # [px], left of and above the panels
_ROWS = ("input depth", "quality Q", "opening W", "angle", "best grasps")
_PAPER, _INK, _FAINT = (24, 26, 30), (235, 235, 235), (160, 164, 170)
_COLOURS = ((60, 140, 255), (255, 150, 30), (60, 220, 90), (255, 70, 70), (200, 100, 255))
_FONT = ImageFont.load_default(13)
_LINE = 19  # [px]


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Grasp map that one detector made of a frame, and its time."""

    name: str
    grasp_map: GraspMap
    milliseconds: float
    """Time of one `predict`, once the detector is warm [ms]."""
    first_milliseconds: float
    """Time of the first `predict` [ms]."""

    def lines(self) -> tuple[str, ...]:
        """Return name, best quality, time and the top grasp in the world, in words."""
        quality = self.grasp_map.quality
        finite = quality[np.isfinite(quality)]
        best = f"{finite.max():.2f}" if finite.size else "none"
        head = (self.name, f"best Q {best},  {self.milliseconds:.1f} ms")
        found = top_grasps(self.grasp_map, count=1)
        if not found:
            return (*head, f"no grasp with Q above {THRESHOLD}")
        grasp, _ = found[0]
        x, y, z = grasp.position
        return (
            *head,
            f"at ({x:.3f}, {y:.3f}, {z:.3f}) m",
            f"angle {np.rad2deg(grasp.angle):.0f}\u00b0,  opening {1e3 * grasp.width:.0f} mm",
        )


def top_grasps(grasp_map: GraspMap, *, count: int = RECTANGLES) -> list[tuple[Grasp, GraspRectangle]]:
    """Return the best grasps in the world and in the image, best first, after non-maximum suppression.

    The first is the one that the loop would choose from this map. Their centres are `DISTANCE` or more apart.
    """
    quality = np.where(np.isfinite(grasp_map.depth), grasp_map.quality, np.nan)
    # of a flat top, the pixel that the loop takes
    quality[best_pixel(quality)] += 1e-6
    found = peaks(quality, threshold=THRESHOLD, distance=DISTANCE, count=count)
    grasps = [grasp_map.grasp_at(int(row), int(col)) for row, col in found]
    return [(grasp, grasp_map.rectangle_of(grasp)) for grasp in grasps]


def side_by_side(
    frame: DepthFrame, predictions: Sequence[Prediction], caption: Sequence[str] = ()
) -> Picture:
    """Return the picture (H, W, 3) of a frame and what the detectors made of it, a column for each.

    Args:
        frame: what all of them saw.
        predictions: one per detector.
        caption: up to four short lines for the corner.

    Raises:
        ConfigError: no prediction at all.
    """
    if not predictions:
        raise ConfigError("nothing to draw", got=0, allowed="one detector's prediction or more")
    step = _SIDE + _GAP
    sheet = np.full((_HEAD + len(_ROWS) * step, _MARGIN + len(predictions) * step, 3), _PAPER, np.uint8)
    for k, prediction in enumerate(predictions):
        left = _MARGIN + k * step
        for m, panel in enumerate(_panels(frame, prediction.grasp_map)):
            sheet[_HEAD + m * step :, left:][:_SIDE, :_SIDE] = panel
    for m, legend in ((1, _bar()), (2, _bar()), (3, _wheel())):
        height, width = legend.shape[:2]
        sheet[_HEAD + m * step + 50 :, 8:][:height, :width] = legend
    image = Image.fromarray(sheet)
    draw = ImageDraw.Draw(image)
    _write(draw, 8, 4, caption)
    for k, prediction in enumerate(predictions):
        _write(draw, _MARGIN + k * step, 4, prediction.lines())
    _write_legends(draw, step)
    return np.asarray(image, np.uint8)


def _panels(frame: DepthFrame, grasp_map: GraspMap) -> list[Picture]:
    """Return the five pictures (_SIDE, _SIDE, 3) of a column."""
    depth = np.where(_holes(frame, grasp_map), np.nan, grasp_map.depth)
    return [
        _fit(shade_depth(depth)),
        _fit(shade(grasp_map.quality, 0.0, 1.0)),
        _fit(shade(grasp_map.world_width(), 0.0, OPENING)),
        _fit(shade_lines(grasp_map.angle, np.nan_to_num(grasp_map.quality))),
        _draw_grasps(grasp_map),
    ]


def _holes(frame: DepthFrame, grasp_map: GraspMap) -> NDArray[np.bool_]:
    """Return the pixels (H, W) of the map that the camera had no return for, filled in since."""
    seen, k = frame.intrinsics, grasp_map.intrinsics
    col = np.rint((np.arange(k.width) - k.cx) / k.fx * seen.fx + seen.cx).astype(int)
    row = np.rint((np.arange(k.height) - k.cy) / k.fy * seen.fy + seen.cy).astype(int)
    return np.isnan(frame.depth[np.ix_(np.clip(row, 0, seen.height - 1), np.clip(col, 0, seen.width - 1))])


def _draw_grasps(grasp_map: GraspMap) -> Picture:
    grey = cv2.cvtColor(_fit(shade_depth(grasp_map.depth)), cv2.COLOR_RGB2GRAY)
    picture = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB), np.uint8)
    scale = np.array([_SIDE / grasp_map.intrinsics.width, _SIDE / grasp_map.intrinsics.height])
    # the best last, so that nothing covers it
    for (_, rectangle), colour in reversed(list(zip(top_grasps(grasp_map), _COLOURS, strict=False))):
        corners = (rectangle.corners() + 0.5) * scale - 0.5
        _line(picture, corners[[0, 1]], colour, 1)
        _line(picture, corners[[2, 3]], colour, 1)
        _line(picture, corners[[1, 2]], colour, 3)  # the fingers
        _line(picture, corners[[3, 0]], colour, 3)
    return picture


def _line(picture: Picture, ends: FloatArray, colour: tuple[int, ...], thickness: int) -> None:
    # cv2 takes pixels in fixed point, here in sixteenths
    start, end = np.rint(ends * 16).astype(int).tolist()
    cv2.line(picture, start, end, colour, thickness, cv2.LINE_AA, 4)


def _fit(picture: Picture) -> Picture:
    return np.asarray(cv2.resize(picture, (_SIDE, _SIDE), interpolation=cv2.INTER_LINEAR), np.uint8)


def _bar() -> Picture:
    return shade(np.repeat(np.linspace(1, 0, 120)[:, None], 14, axis=1))


def _wheel() -> Picture:
    """Return a disc in which every direction has the colour of the grasps that close along it."""
    y, x = np.mgrid[-45:46, -45:46]
    disc = shade_lines(np.arctan2(-y, x), np.ones(x.shape))
    disc[np.hypot(x, y) > 45] = _PAPER
    return disc


def _write_legends(draw: ImageDraw.ImageDraw, step: int) -> None:
    tops = [_HEAD + m * step + 4 for m in range(len(_ROWS))]
    for top, name in zip(tops, _ROWS, strict=True):
        _write(draw, 8, top, [name])
    _write(draw, 8, tops[0] + 24, ["near bright", "grey: no return"], _FAINT)
    for top, ends in ((tops[1], ("1", "0")), (tops[2], (f"{1e3 * OPENING:.0f} mm", "0"))):
        _write(draw, 28, top + 40, [ends[0]], _FAINT)
        _write(draw, 28, top + 152, [ends[1]], _FAINT)
    _write(draw, 8, tops[3] + 24, ["closes along"], _FAINT)
    _write(draw, 8, tops[3] + 140, ["dark: Q is low"], _FAINT)
    for rank, colour in enumerate(_COLOURS):
        _write(draw, 8, tops[4] + 24 + rank * _LINE, ["best" if rank == 0 else f"{rank + 1}."], colour)
    _write(draw, 8, tops[4] + 30 + RECTANGLES * _LINE, ["bold: fingers"], _FAINT)


def _write(
    draw: ImageDraw.ImageDraw, left: int, top: int, lines: Sequence[str], colour: tuple[int, ...] = _INK
) -> None:
    for k, line in enumerate(lines):
        draw.text((left, top + _LINE * k), line, fill=colour, font=_FONT)
