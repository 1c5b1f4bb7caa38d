"""Grasps that close along the rows of a turned height map: run lengths, pockets and edges."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import cv2
import numpy as np

from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.detectors.antipodal.landing import Landing, Runs
from mpgrasp.detectors.antipodal.windows import Float32, highest, odd
from mpgrasp.geometry import FloatArray

LEVEL_STEP = 0.008
"""Spacing of the tip heights that are tried above the cloth [m]."""
ANGLE_TOLERANCE = np.deg2rad(10.0)
"""Misalignment of the edges that halves a grasp's worth, roughly; the object would be turned [rad]."""
OFFSET_TOLERANCE = 0.004
"""Offset of the centre from the middle between the contacts that halves the worth likewise [m]."""
UNEVENNESS_TOLERANCE = 0.003
"""Distance by which the first contact stands out of the mean edge that halves it likewise [m]."""
ARM_TOLERANCE = 0.025
"""Distance of the grasp from the object's centre of mass that halves it likewise [m]."""
SLANT = np.deg2rad(5.0)
"""Misalignment that the fit of the edges makes good afterwards [rad]."""
FULL_CONTACT = 0.012
"""Contact of that length across the closing direction is as good as any longer one [m]."""
NEIGHBOURHOOD = 0.05
"""No finger, with its margin, reaches farther beside what it grasps [m]."""
LANDING = 0.6
"""Worth of a grasp whose tips stop on something other than the support."""


class TurnedMap:
    """A height map whose rows run along the closing direction; lengths are in cells unless [m] is said."""

    def __init__(
        self, height: Float32, label: Float32, masses: FloatArray, cell: float, hand: HandGeometry
    ) -> None:
        self.height = np.ascontiguousarray(height)
        self.label = np.ascontiguousarray(label)
        self.masses = masses  # (n, 2) as (col, row)
        self.cell, self.hand = cell, hand
        self.finger = odd((hand.pad_width + hand.play) / cell)
        self.pad = odd(hand.pad_width / cell)
        self.landing = Landing.on(self.height, self.label, cell, hand)
        self.top = float(self.height[self.label > 0].max(initial=0))  # [m]
        self.under_palm = None
        if self.top > hand.palm_clearance:
            along, across = hand.palm_size
            self.under_palm = highest(self.height, odd(across / cell), odd(along / cell))
        self.under_camera = None
        if self.top > hand.camera_clearance:
            along, across = hand.camera_size
            under = highest(self.height, odd(across / cell), odd(along / cell))
            shift = min(round(hand.camera_offset / cell), len(under))
            padded = np.pad(under, ((shift, shift), (0, 0)))
            # the hand may come in either way round
            self.under_camera = np.maximum(padded[: len(under)], padded[2 * shift :])
        self._count_cells()

    def _count_cells(self) -> None:
        n_rows, n_columns = self.label.shape
        self.columns = np.arange(n_columns, dtype=np.int32)
        self.rows = (np.arange(n_rows, dtype=np.float32) - n_rows / 2)[:, None]

    def levels(self) -> list[float]:
        """Return tip heights [m] to try, from the cloth up; the lowest stands for the cloth itself."""
        return [0.0, *np.arange(LEVEL_STEP, self.top - 0.004, LEVEL_STEP)] if self.top > 0.014 else [0.0]

    def around(self, level: float) -> tuple[TurnedMap | None, tuple[slice, slice]]:
        """Return this map cut down to what matters at a tip height, and its place; None = nothing there."""
        occupied = (self.label > 0) & (self.height > level) if level > 0 else self.label > 0
        rows, cols = np.flatnonzero(occupied.any(axis=1)), np.flatnonzero(occupied.any(axis=0))
        if not len(rows):
            return None, np.s_[0:0, 0:0]
        pad = int(np.ceil(NEIGHBOURHOOD / self.cell))
        top, left = max(rows[0] - pad, 0), max(cols[0] - pad, 0)
        window = np.s_[top : rows[-1] + pad + 1, left : cols[-1] + pad + 1]
        part = copy.copy(self)
        for name in ("height", "label", "under_palm", "under_camera"):
            whole = getattr(self, name)
            setattr(part, name, None if whole is None else np.ascontiguousarray(whole[window]))
        part.landing = self.landing.cut(window)
        part.masses = self.masses - (left, top)
        part._count_cells()
        return part, window

    def add_grasps(self, level: float, result: Float32) -> None:
        """Write the grasps at one tip height into `result` (h, w, 3) where they are better."""
        hand, cell = self.hand, self.cell
        on_cloth = level == 0
        occupied = self.label > 0
        if not on_cloth:
            occupied &= self.height > level
        if not occupied.any():
            return
        # no finger fits into a gap narrower than itself: close them, so that rings and forks have a middle
        narrow = odd((hand.finger_thickness + 2 * hand.margin[0]) / cell)
        solid = cv2.morphologyEx(occupied.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((1, narrow), np.uint8))
        slab = cv2.dilate(solid, np.ones((self.finger, 1), np.uint8)) > 0
        first, last = self._runs(slab)
        middle = (first + last) * 0.5
        candidate = (solid > 0) & ((last - first + 1) * cell <= hand.max_contact_width)
        # the palm stops the hand at this level or lower down
        candidate &= self.height - hand.reach < level + LEVEL_STEP / 2
        candidate &= np.abs(self.columns - middle) * cell < 3 * OFFSET_TOLERANCE
        r, c = np.nonzero(candidate)
        if not len(r):
            return
        # purity: one object in the whole run, over the finger's width
        least = cv2.erode(np.where(occupied, self.label, 1e6).astype(np.float32), np.ones((self.finger, 1)))
        most = cv2.dilate(np.where(occupied, self.label, 0).astype(np.float32), np.ones((self.finger, 1)))
        filled = most > 0
        previous = np.maximum.accumulate(np.where(filled, self.columns, 0), axis=1)
        before = np.take_along_axis(most, np.pad(previous[:, :-1], ((0, 0), (1, 0))), 1)
        mixed = filled & ((most != least) | ((before != most) & (before > 0)))
        mixed_so_far = np.cumsum(mixed, axis=1)
        a, b = first[r, c], last[r, c]
        # the first column of a run may differ from the object before the free gap, which is no matter
        pure = (mixed_so_far[r, b] == mixed_so_far[r, a]) & (most[r, a] == least[r, a])
        r, c, a, b = r[pure], c[pure], a[pure], b[pure]
        if not len(r):
            return

        run = (b - a + 1) * cell  # [m]
        margin = self._free(slab, r, a, b) - hand.finger_thickness
        if self.top > level + hand.tip_height:
            tall = cv2.dilate(
                ((self.height > level + hand.tip_height) & (self.label > 0)).astype(np.uint8),
                np.ones((self.finger, 1), np.uint8),
            )
            margin = np.minimum(margin, self._free(tall > 0, r, a, b) - hand.shaft_thickness)
        room = margin - 0.5 * cell >= np.minimum(hand.margin[0], (hand.max_opening - run) / 2)
        free = margin - 0.5 * cell
        margin = np.minimum(np.minimum(free, (hand.max_opening - run) / 2), hand.margin[1])
        # where the tips stop: on what lies under the open fingers, or where the palm forbids to go on
        runs = Runs(row=r, first=a, last=b)
        if on_cloth and hand.wider:
            free = np.minimum(free, (hand.max_opening - run) / 2)
            margin, landing = self.landing.deepest(runs, self.height[r, c], margin, free)
        else:
            landing = self.landing.height(runs, margin)
        wanted = np.maximum(self.height[r, c] - hand.reach, 0)
        tip = np.maximum(wanted, landing)
        good = room
        if on_cloth:
            good &= wanted < landing + LEVEL_STEP / 2
            lands = np.zeros(len(r), bool)
        else:
            good &= (tip < level + LEVEL_STEP / 2) & (tip > level - 1.5 * LEVEL_STEP)
            lands = landing > wanted + LEVEL_STEP / 2
        if self.under_palm is not None:
            good &= self.under_palm[r, c] - tip <= hand.palm_clearance
        if self.under_camera is not None:
            good &= self.under_camera[r, c] - tip <= hand.camera_clearance
        if not good.any():
            return
        r, c, a, run, margin, tip, lands = (x[good] for x in (r, c, a, run, margin, tip, lands))

        edges = self._edges(solid, on_cloth, r, c)
        q = np.where(lands, LANDING, 1.0)
        depth = edges.height - tip
        q *= (depth >= hand.min_depth) * (edges.steep > 0.7)
        q *= np.clip(0.45 + 0.45 * (depth - hand.min_depth) / hand.depth_range, 0, 0.9)
        q *= 1 + 0.11 * np.clip((depth - hand.min_depth - hand.depth_range) / 0.005, 0, 1)
        q *= np.clip(edges.length / FULL_CONTACT, 0, 1)
        q *= np.clip(1 - (edges.wedge / hand.friction_angle) ** 2, 0, 1)
        q *= _bell(edges.turn / ANGLE_TOLERANCE)
        slant = self.finger * cell * np.abs(np.tan(np.clip(edges.turn, -SLANT, SLANT)))
        q *= _bell(np.maximum(run - slant - edges.run, 0) / 2 / UNEVENNESS_TOLERANCE)
        q *= _bell((c - edges.middle) * cell / OFFSET_TOLERANCE)
        q *= np.clip(0.5 + 0.5 * (margin - 0.004) / 0.003, 0, 1)
        mass = self.masses[most[r, a].astype(int)]
        arm = np.hypot(c - mass[:, 0], r - mass[:, 1]) * cell
        q *= 0.3 + 0.7 * _bell(arm / ARM_TOLERANCE)

        better = q > result[r, c, 0]
        opening = np.minimum(run - slant + 2 * margin, hand.max_opening) - hand.opening_margin
        result[r[better], c[better]] = np.column_stack([q, opening, edges.turn])[better]

    def _runs(self, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the first and last column (h, w) of the row-wise run of `mask` that holds each cell."""
        n = mask.shape[1]
        padded = np.pad(mask, ((0, 0), (1, 1)))
        starts = mask & ~padded[:, :-2]
        ends = mask & ~padded[:, 2:]
        first = np.maximum.accumulate(np.where(starts, self.columns, 0), axis=1)
        last = np.minimum.accumulate(np.where(ends, self.columns, n - 1)[:, ::-1], axis=1)[:, ::-1]
        return first, last

    def _free(self, mask: np.ndarray, r: np.ndarray, a: np.ndarray, b: np.ndarray) -> FloatArray:
        """Return the free length [m] beside columns a and b of rows r, the lesser of both sides."""
        n = mask.shape[1]
        before = np.maximum.accumulate(np.where(mask, self.columns, -n), axis=1)
        after = np.minimum.accumulate(np.where(mask, self.columns, 2 * n)[:, ::-1], axis=1)[:, ::-1]
        left = np.where(a > 0, a - 1 - before[r, np.maximum(a - 1, 0)], n)
        right = np.where(b < n - 1, after[r, np.minimum(b + 1, n - 1)] - b - 1, n)
        free: FloatArray = np.minimum(left, right) * self.cell
        return free

    def _edges(self, solid: np.ndarray, on_cloth: bool, r: np.ndarray, c: np.ndarray) -> _Edges:
        """Fit straight lines to both edges of the runs within the pad's width around cells (r, c)."""
        n_columns = solid.shape[1]
        first, last = self._runs(solid > 0)
        mask = (solid > 0).astype(np.float32)
        row = self.rows * mask
        inner = [np.take_along_axis(self.height, k, 1) for k in (first, last)]
        steep = mask
        if not on_cloth:
            steep = mask.copy()
            for k, edge, away in zip((first, last), inner, (-2, 2), strict=True):
                beyond = np.clip(k + away, 0, n_columns - 1)
                drop = edge - np.take_along_axis(self.height, beyond, 1)
                # an outline's edge is a vertical wall or the widest section; inside of it the slope decides
                outline = np.take_along_axis(self.label, beyond, 1) != np.take_along_axis(self.label, k, 1)
                steep *= outline | (drop > 1.5 * 2 * self.cell)
        sums = [
            cv2.boxFilter(
                np.asarray(x, np.float32), -1, (1, self.pad), normalize=False, borderType=cv2.BORDER_CONSTANT
            )[r, c]
            for x in (
                mask, row, row * row, first * mask, last * mask, first * row, last * row,
                inner[0] * mask, inner[1] * mask, steep,
            )
        ]  # fmt: skip
        n, sr, srr, sa, sb, sra, srb, ha, hb, st = (x.astype(float) for x in sums)
        spread = n * srr - sr * sr
        slope_a, slope_b = (
            np.arctan(np.where(spread > 0.5, (n * srx - sr * sx) / np.maximum(spread, 0.5), 0))
            for srx, sx in ((sra, sa), (srb, sb))
        )
        return _Edges(
            length=n * self.cell,
            height=np.minimum(ha, hb) / n,
            steep=st / n,
            # an edge that leans by +slope along the rows is met squarely after turning back by it
            turn=-(slope_a + slope_b) / 2,
            wedge=np.abs(slope_a - slope_b) / 2,
            run=((sb - sa) / n + 1) * self.cell,
            middle=(sa + sb) / (2 * n),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Edges:
    """Edges that both pads meet, for n candidates; all (n,)."""

    length: FloatArray  # of contact across the closing direction [m]
    height: FloatArray  # of the lower of both edges [m]
    steep: FloatArray  # share of the contact that does not squeeze the object out
    turn: FloatArray  # by which the closing direction is to be turned [rad]
    wedge: FloatArray  # half the angle between both edges [rad]
    run: FloatArray  # mean distance between the edges [m]
    middle: FloatArray  # between them, column


def _bell(x: FloatArray) -> FloatArray:
    bell: FloatArray = np.exp(-0.5 * x * x)
    return bell
