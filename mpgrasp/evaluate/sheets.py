"""Pictures of an evaluation: predictions as in the paper's Figs. 4 and 7, and the images that went worst."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.evaluate.predict import Square, grasps, predict
from mpgrasp.evaluate.scores import TOP
from mpgrasp.grasp import GraspRectangle
from mpgrasp.recording.false_colour import shade, shade_depth, shade_lines

Picture = NDArray[np.uint8]
TILE = 240
"""Side of a picture on a sheet [px]."""
COLOURS = ((31, 119, 180), (255, 127, 14), (44, 160, 44), (214, 39, 40), (148, 103, 189))
"""Of the best five grasps, in their order: the paper's Fig. 7."""
LABEL = ((255, 255, 255),)
"""Of all labels."""
IN_A_ROW = 4


def prediction_sheet(images: Sequence[Square], detectors: Mapping[str, GraspDetector]) -> Picture:
    """Return a sheet with two rows for each image, above and below each other.

    The first row holds the image with its labels, then the best five grasps of every detector; the row below
    its depth, then every detector's quality, angle and width beside each other.
    """
    rows: list[Picture] = []
    for seen in images:
        image = seen.image
        base = shade_depth(image.depth) if image.rgb is None else image.rgb
        above = [_tile(base, image.rectangles, LABEL)]
        below = [_tile(shade_depth(image.depth))]
        for detector in detectors.values():
            maps = predict(detector, image)
            above.append(_tile(base, grasps(maps, image.depth.shape[0], TOP), COLOURS))
            small = [
                shade(maps.quality, 0.0, 1.0),
                shade_lines(maps.angle, np.clip(maps.quality, 0, 1)),
                shade(maps.width, 0.0),
            ]
            third = TILE // 3
            strip = np.full((TILE, TILE, 3), 255, np.uint8)
            strip[:TILE] = _tile(small[0])
            for k, picture in enumerate(small[1:]):
                strip[TILE - third :, k * third : (k + 1) * third] = cv2.resize(picture, (third, third))
            below.append(strip)
        rows += [np.hstack(above), np.hstack(below)]
    return np.vstack(rows)


def worst_sheet(images: Sequence[Square]) -> Picture:
    """Return depth images with their labels, `IN_A_ROW` beside each other."""
    tiles = [_tile(shade_depth(seen.image.depth), seen.image.rectangles, LABEL) for seen in images]
    while len(tiles) % IN_A_ROW:
        tiles.append(np.full((TILE, TILE, 3), 255, np.uint8))
    return np.vstack([np.hstack(tiles[k : k + IN_A_ROW]) for k in range(0, len(tiles), IN_A_ROW)])


def png(picture: Picture) -> bytes:
    """Return a picture as a PNG file."""
    ok, data = cv2.imencode(".png", picture[..., ::-1])
    assert ok
    return bytes(data.tobytes())


def _tile(
    picture: Picture,
    rectangles: Iterable[GraspRectangle] = (),
    colours: Sequence[tuple[int, int, int]] = LABEL,
) -> Picture:
    """Return a picture of `TILE` px with rectangles in these colours in turn, the first one on top."""
    scale = TILE / picture.shape[0]
    tile = cv2.resize(np.ascontiguousarray(picture), (TILE, TILE), interpolation=cv2.INTER_AREA)
    for k, rectangle in reversed(list(enumerate(rectangles))):
        corners = np.rint((rectangle.corners() + 0.5) * scale - 0.5).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(tile, [corners], True, colours[k % len(colours)], 1, cv2.LINE_AA)
    return np.asarray(tile, np.uint8)
