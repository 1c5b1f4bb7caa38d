"""Laws about the form of grasp maps, whatever the frame."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from dataclasses import replace

import numpy as np

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.check.detector_subject import BOX, HEIGHTS, DetectorSubject, boxes_in_rows
from mpgrasp.check.laws import Broken, Law
from mpgrasp.check.solids import frame
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import reads_colour
from mpgrasp.grasp import PEAK_QUALITY, GraspMap
from mpgrasp.guards.asking import ask_detector

NEAR = 0.005
"""Depths that differ by less are of the same surface [m]."""
AGREE = 0.9
"""Least share of pixels on the right surface; the others lie at edges."""


def _name(subject: DetectorSubject) -> str:
    name = getattr(subject.detector, "name", None)
    if not isinstance(name, str) or not name:
        raise Broken(f'it has no name: write `name = "mine"` into the class (name is {name!r})')
    return name


def _form(subject: DetectorSubject) -> str:
    shapes = {subject.look(BOX, height=height).quality.shape for height in HEIGHTS}
    return (
        f"maps of {' and '.join(map(str, sorted(shapes)))} in range and finite, from {len(HEIGHTS)} heights"
    )


def _geometry(subject: DetectorSubject) -> str:
    boxes = tuple(boxes_in_rows())
    subject.reset(*boxes)
    image = subject.frame(*boxes, yaw=0.4)
    view = ask_detector(subject.detector, image)
    share = _agreement(view, image)
    if share < AGREE:
        raise Broken(
            f"only {100 * share:.0f} % of the map's pixels lie on the surface that the frame has there: the "
            f"map's `intrinsics` are not those of its image; take them from what crop_resize returned, and "
            f"`depth` too"
        )
    return f"{100 * share:.0f} % of the map's pixels lie where the frame sees the same surface"


def _agreement(view: GraspMap, image: DepthFrame) -> float:
    """Return the share of a map's pixels whose world points the frame sees where they are."""
    points = view.world_points()
    u, v = np.moveaxis(np.rint(image.pixels(points)), -1, 0).astype(int)
    inside = (u >= 0) & (u < image.intrinsics.width) & (v >= 0) & (v < image.intrinsics.height)
    seen = image.depth[v.clip(0, image.intrinsics.height - 1), u.clip(0, image.intrinsics.width - 1)]
    return float((inside & (np.abs(seen - view.depth) < NEAR)).mean())


def _frame_is_kept(subject: DetectorSubject) -> str:
    image = subject.frame(BOX)
    before = image.depth.copy()
    subject.reset(BOX)
    ask_detector(subject.detector, image)
    if not np.array_equal(before, image.depth, equal_nan=True):
        raise Broken("predict writes into frame.depth, which others read too: work on frame.depth.copy()")
    return "the frame is not written into"


def _no_returns(subject: DetectorSubject) -> str:
    image = subject.frame(BOX)
    subject.reset(BOX)
    blind = replace(image, depth=np.full_like(image.depth, np.nan))
    view = ask_detector(subject.detector, blind)
    if view.quality.any():
        raise Broken(
            f"a frame without any return (all NaN) has a grasp of quality {view.quality.max():.3g}: return "
            f"quality 0 where numpy.isnan(frame.depth).all()"
        )
    return "a frame of NaN alone has quality 0 everywhere"


def _holes(subject: DetectorSubject) -> str:
    image = subject.frame(BOX)
    lost = np.random.default_rng(0).random(image.depth.shape) < 0.3
    lost[180:260, 250:300] = True
    subject.reset(BOX)
    ask_detector(subject.detector, replace(image, depth=np.where(lost, np.float32(np.nan), image.depth)))
    return "a frame with a third of its pixels lost gives a sound map"


def _constant(subject: DetectorSubject) -> str:
    image = subject.frame()
    subject.reset()
    highest = float(ask_detector(subject.detector, image).quality.max())
    if highest > PEAK_QUALITY:
        raise Broken(
            f"an empty table, seen without noise, has a grasp of quality {highest:.2f}: controllers go where "
            f"quality is above {PEAK_QUALITY:g}"
        )
    return f"an empty table has no peak (best quality {highest:.2g})"


def _other_size(subject: DetectorSubject) -> str:
    small = D435_INTRINSICS.crop(120, 160, 240, 320)
    image = frame(BOX, height=HEIGHTS[1], colour=reads_colour(subject.detector), intrinsics=small)
    subject.reset(BOX)
    ask_detector(subject.detector, image)
    return "a frame of 320 x 240 gives a sound map"


def _silent(subject: DetectorSubject) -> str:
    text = io.StringIO()
    with redirect_stdout(text):
        subject.look(BOX)
    if text.getvalue():
        raise Broken(
            f"predict prints ({text.getvalue().strip()[:40]!r}): use logging, a run has thousands of ticks"
        )
    return "nothing is printed"


LAWS: tuple[Law[DetectorSubject], ...] = (
    Law(name="name", check=_name),
    Law(name="form, range, type", check=_form),
    Law(name="geometry of the map", check=_geometry),
    Law(name="frame left as it is", check=_frame_is_kept),
    Law(name="frame without returns", check=_no_returns),
    Law(name="frame with holes", check=_holes),
    Law(name="empty table", must=False, check=_constant),
    Law(name="frame of another size", must=False, check=_other_size),
    Law(name="prints nothing", must=False, check=_silent),
)
"""In the order in which they are tried."""
