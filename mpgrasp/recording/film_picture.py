"""Layout of a film's pictures: the watched scene, the maps beside it, and lines of text below."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mpgrasp.recording.false_colour import Picture
from mpgrasp.recording.watcher import VIEW

SIZE = (640, 360)
"""Width and height of a film's pictures [px]."""
PANELS = ("depth", "Q", "entropy", "utility")
"""Names of the maps, row by row."""

_PANEL = (144, 138)  # [px]
_LABEL = 18  # [px], above a panel
_INK, _PAPER = (235, 235, 235), (24, 26, 30)
_FONT = ImageFont.load_default(13)


def compose(view: Picture, panels: Mapping[str, Picture], caption: str, event: str) -> Picture:
    """Return a picture (360, 640, 3) of the scene, of the maps by name, and of two lines of text."""
    canvas = np.full((SIZE[1], SIZE[0], 3), _PAPER, np.uint8)
    canvas[: VIEW[1], : VIEW[0]] = view
    for k, name in enumerate(PANELS):
        left = VIEW[0] + k % 2 * _PANEL[0]
        top = k // 2 * (_PANEL[1] + _LABEL)
        _write(canvas[top : top + _LABEL, left : left + _PANEL[0]], [name])
        if name in panels:
            side = min(_PANEL) - 4
            small = cv2.resize(panels[name], (side, side), interpolation=cv2.INTER_AREA)
            canvas[top + _LABEL : top + _LABEL + side, left + 4 : left + 4 + side] = small
    write_caption(canvas, caption, event)
    return canvas


def write_caption(canvas: Picture, caption: str, event: str) -> None:
    """Put other lines of text into a composed picture, in place."""
    strip = canvas[VIEW[1] :]
    strip[:] = _PAPER
    _write(strip, [caption, event])


def _write(area: Picture, lines: list[str]) -> None:
    """Write lines of text into part of a picture, in place."""
    image = Image.fromarray(area)
    draw = ImageDraw.Draw(image)
    for k, line in enumerate(lines):
        draw.text((8, 2 + 21 * k), line, fill=_INK, font=_FONT)
    area[:] = np.asarray(image)
