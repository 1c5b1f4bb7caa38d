"""Dense antipodal, collision-free top-down grasps from a height map and the hand's real geometry.

The map is turned so that the closing direction runs along its rows. There the hand is made of boxes, so
every question is a run length or a rectangular filter: a row-wise run of occupied cells is what the pads
close on, the free run beside it is the pocket for a finger, and sums over the pad's width fit straight
lines to the two edges, which say whether they face the pads and by how much the angle is off.

The analysis assumes how a grasp is executed: the tips go down to the cloth, or as far below the surface as
the palm allows where the object is taller than the fingers. Where something lower is in the way the tips
stop on it, and the grasp is marked down.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, wrap_half_pi
from mpgrasp.height_map import HeightMap

Float32 = NDArray[np.float32]

LEVEL_STEP = 0.008
"""Spacing of the tip heights that are tried above the cloth [m]."""
ANGLE_TOLERANCE = np.deg2rad(10.0)
"""Misalignment of the edges that halves a grasp's worth, roughly; the object would be turned [rad]."""
OFFSET_TOLERANCE = 0.004
"""Likewise the offset of the centre from the middle between the contacts [m]."""
UNEVENNESS_TOLERANCE = 0.003
"""Likewise how far the pads' first contact stands out of the mean edge [m]."""
ARM_TOLERANCE = 0.025
"""Likewise the distance of the grasp from the object's centre of mass [m]."""
SLANT = np.deg2rad(5.0)
"""Misalignment that the fit of the edges makes good afterwards [rad]."""
SLIDE = 0.010
"""Length across the closing direction over which a grasp's worth is averaged: the hand may be that far off [m]."""
FULL_CONTACT = 0.012
"""Contact of that length across the closing direction is as good as any longer one [m]."""
LANDING = 0.6
"""Worth of a grasp whose tips stop on something other than the support."""


@dataclass(frozen=True, kw_only=True)
class HandGeometry:
    """The hand as the analysis sees it: boxes around pads, fingers and palm; a Panda hand by default."""

    pad_width: float = 0.0176
    """Of a pad across the closing direction [m]."""
    play: float = 0.004
    """Free space wanted around a finger across the closing direction, both sides together [m]."""
    finger_thickness: float = 0.0144
    """Space that a finger tip needs outside of the opening [m]."""
    shaft_thickness: float = 0.026
    """Space that a finger needs outside of the opening above its straight tip [m]."""
    tip_height: float = 0.016
    """Height of the straight tip [m]."""
    max_opening: float = 0.080
    """Widest opening between the pads [m]."""
    max_contact_width: float = 0.072
    """Widest thing to close on, so that both fingers still pass beside it [m]."""
    reach: float = 0.042
    """How far the tips go below the surface point before the palm comes near [m]."""
    palm_clearance: float = 0.045
    """How far above the tips anything under the palm may rise [m]."""
    palm_size: tuple[float, float] = (0.204, 0.064)
    """The palm along and across the closing direction [m]."""
    camera_clearance: float = 0.070
    """How far above the tips anything under the wrist camera may rise [m]."""
    camera_offset: float = 0.070
    """From the tool point to the camera, across the closing direction and on either side [m]."""
    camera_size: tuple[float, float] = (0.094, 0.034)
    """The camera along and across the closing direction, with a little play [m]."""
    tip_clearance: float = 0.0005
    """Height of the tips over what they stop on [m]."""
    margin: tuple[float, float] = (0.005, 0.008)
    """Least and wanted free space between object and open pad, on each side [m]."""
    opening_margin: float = 0.010
    """What the execution adds to a grasp's width, both sides together [m]; at most twice the least margin."""
    min_depth: float = 0.0012
    """Least height of the contacts above the tips [m]."""
    friction_angle: float = np.deg2rad(25.0)
    """Half the friction cone, on the safe side [rad]."""

    def __post_init__(self) -> None:
        if not 0 < self.max_contact_width < self.max_opening:
            raise ConfigError(
                "contact width outside of the opening",
                got=self.max_contact_width,
                allowed=f"between 0 and max_opening = {self.max_opening}",
            )
        if not 0 <= self.margin[0] < self.margin[1]:
            raise ConfigError("margins out of order", got=self.margin, allowed="(least, wanted), least first")
        if not 0 <= self.opening_margin <= 2 * self.margin[0]:
            raise ConfigError(
                "unusable opening margin", got=self.opening_margin, allowed=f"0 to {2 * self.margin[0]}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class WorldGrasps:
    """The best grasp centred on each cell of a height map."""

    quality: Float32
    """(ny, nx) in [0, 1]; 0 = no grasp."""
    angle: Float32
    """(ny, nx) closing direction about world z [rad], in [-pi/2, pi/2)."""
    width: Float32
    """(ny, nx) what to close on and a margin; the execution adds its own to it [m]."""
    height_map: HeightMap
    """The grid and scene that the arrays belong to."""


def antipodal_grasps(
    height_map: HeightMap, hand: HandGeometry | None = None, *, n_angles: int = 18
) -> WorldGrasps:
    """Grasps centred on every cell of the map.

    Args:
        height_map: the scene.
        hand: geometry of the gripper.
        n_angles: closing directions that are tried; the result is finer, because edges are fitted.
    """
    hand = hand or HandGeometry()
    quality, angle, width = (np.zeros(height_map.height.shape, np.float32) for _ in range(3))
    grasps = WorldGrasps(quality=quality, angle=angle, width=width, height_map=height_map)
    rows, cols = np.nonzero(height_map.label)
    if not len(rows):
        return grasps
    # only the cells around objects matter: a finger and its margin beyond them
    pad = int(np.ceil(0.04 / height_map.cell))
    window = (
        slice(max(rows.min() - pad, 0), rows.max() + pad + 1),
        slice(max(cols.min() - pad, 0), cols.max() + pad + 1),
    )
    height, label = (np.asarray(a[window], np.float32) for a in (height_map.height, height_map.label))
    above = (height - height_map.support[window]).astype(np.float32)
    masses = _centres_of_mass(above, label)
    angles = -np.pi / 2 + np.pi * np.arange(n_angles) / n_angles
    stack = np.stack([_at_angle(height, label, masses, theta, height_map.cell, hand) for theta in angles])
    q, opening, turn = np.moveaxis(stack, -1, 0)  # each (n_angles, h, w)
    # a grasp that still holds a little off its angle is the better one
    robust = np.where(q > 0, 0.5 * q + 0.25 * (np.roll(q, 1, 0) + np.roll(q, -1, 0)), 0)
    best = robust.argmax(axis=0)[None]
    quality[window], opening, turn = (np.take_along_axis(a, best, 0)[0] for a in (robust, opening, turn))
    found = quality[window] > 0
    half_bin = 0.6 * np.pi / n_angles
    angle[window] = np.where(found, wrap_half_pi(angles[best[0]] + np.clip(turn, -half_bin, half_bin)), 0)
    width[window] = np.where(found, opening, 0)
    return grasps


def _centres_of_mass(above: Float32, label: Float32) -> FloatArray:
    """(n_labels, 2) as (row, col) of what is seen of each object, weighted by height; row 0 is unused."""
    flat = label.astype(int).ravel()
    rows, cols = np.indices(label.shape).reshape(2, -1)
    weight = np.maximum(above.ravel(), 1e-4)
    total = np.maximum(np.bincount(flat, weight), 1e-9)
    return np.column_stack([np.bincount(flat, weight * rows), np.bincount(flat, weight * cols)]) / total[:, None]


def _at_angle(
    height: Float32, label: Float32, masses: FloatArray, theta: float, cell: float, hand: HandGeometry
) -> Float32:
    """Quality, opening [m] and turn [rad] (h, w, 3) of grasps that close along `theta`."""
    h, w = label.shape
    c, s = np.cos(theta), np.sin(theta)
    R = np.array([[c, -s], [s, c]])  # turned (col, row) offsets -> the map's
    size = np.ceil(np.abs(R).T @ (w, h)).astype(int) + 1
    offset = np.array([w - 1, h - 1]) / 2 - R @ (size - 1) / 2
    turned = cv2.warpAffine(
        np.dstack([height, label]),
        np.column_stack([R, offset]),
        (int(size[0]), int(size[1])),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
    )
    view = _TurnedView(turned[..., 0], turned[..., 1], (masses[:, ::-1] - offset) @ R, cell, hand)
    result = np.zeros((*turned.shape[:2], 3), np.float32)
    for level in view.levels():
        view.add_grasps(level, result)
    q = np.minimum(result[..., :1], 1)
    along = _odd(SLIDE / cell)
    # the worth over a few places, the fitted angle and opening weighted by it over a few more: cells are coarse
    result[..., :1] = np.where(q > 0, cv2.blur(q, (1, along), borderType=cv2.BORDER_CONSTANT)[..., None], 0)
    weighted = cv2.blur(np.dstack([q, q * result[..., 1:]]), (3, along), borderType=cv2.BORDER_CONSTANT)
    result[..., 1:] = weighted[..., 1:] / np.maximum(weighted[..., :1], 1e-6)
    back = np.column_stack([R.T, -R.T @ offset])
    return np.asarray(cv2.warpAffine(result, back, (w, h), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP))


class _TurnedView:
    """A height map whose rows run along the closing direction; lengths are in cells unless [m] is said."""

    def __init__(
        self, height: Float32, label: Float32, masses: FloatArray, cell: float, hand: HandGeometry
    ) -> None:
        self.height = np.ascontiguousarray(height)
        self.label = np.ascontiguousarray(label)
        self.masses = masses  # (n, 2) as (col, row)
        self.cell, self.hand = cell, hand
        self.finger = _odd((hand.pad_width + hand.play) / cell)
        self.pad = _odd(hand.pad_width / cell)
        thickness = _odd((hand.finger_thickness + 0.002) / cell)
        self.under_finger = _highest(self.height, self.finger, thickness)
        self.top = float(self.height[self.label > 0].max(initial=0))  # [m]
        self.under_palm = None
        if self.top > hand.palm_clearance:
            along, across = hand.palm_size
            self.under_palm = _highest(self.height, _odd(across / cell), _odd(along / cell))
        self.under_camera = None
        if self.top > hand.camera_clearance:
            along, across = hand.camera_size
            under = _highest(self.height, _odd(across / cell), _odd(along / cell))
            shift = min(round(hand.camera_offset / cell), len(under))
            padded = np.pad(under, ((shift, shift), (0, 0)))
            # the hand may come in either way round
            self.under_camera = np.maximum(padded[: len(under)], padded[2 * shift :])
        self.columns = np.arange(label.shape[1], dtype=np.int32)
        self.rows = (np.arange(label.shape[0], dtype=np.float32) - label.shape[0] / 2)[:, None]

    def levels(self) -> list[float]:
        """Tip heights [m] to try, from the cloth up; the lowest stands for the cloth itself."""
        return [0.0, *np.arange(LEVEL_STEP, self.top - 0.004, LEVEL_STEP)] if self.top > 0.014 else [0.0]

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
        narrow = _odd((hand.finger_thickness + 2 * hand.margin[0]) / cell)
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
        margin = np.minimum(np.minimum(margin - 0.5 * cell, (hand.max_opening - run) / 2), hand.margin[1])
        # where the tips stop: on what lies under the open fingers, or where the palm forbids to go on
        reach = np.rint((margin + hand.finger_thickness / 2) / cell).astype(int)
        left, right = np.maximum(a - reach, 0), np.minimum(b + reach, len(self.columns) - 1)
        landing = np.maximum(self.under_finger[r, left], self.under_finger[r, right]) + hand.tip_clearance
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
        q *= np.clip(0.45 + 0.45 * (depth - hand.min_depth) / 0.002, 0, 0.9)
        q *= 1 + 0.11 * np.clip((depth - hand.min_depth - 0.002) / 0.005, 0, 1)
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
        """First and last column (h, w) of the row-wise run of `mask` that holds each cell."""
        n = mask.shape[1]
        padded = np.pad(mask, ((0, 0), (1, 1)))
        starts = mask & ~padded[:, :-2]
        ends = mask & ~padded[:, 2:]
        first = np.maximum.accumulate(np.where(starts, self.columns, 0), axis=1)
        last = np.minimum.accumulate(np.where(ends, self.columns, n - 1)[:, ::-1], axis=1)[:, ::-1]
        return first, last

    def _free(self, mask: np.ndarray, r: np.ndarray, a: np.ndarray, b: np.ndarray) -> FloatArray:
        """Free length [m] beside columns a and b of rows r, the lesser of both sides."""
        n = mask.shape[1]
        before = np.maximum.accumulate(np.where(mask, self.columns, -n), axis=1)
        after = np.minimum.accumulate(np.where(mask, self.columns, 2 * n)[:, ::-1], axis=1)[:, ::-1]
        left = np.where(a > 0, a - 1 - before[r, np.maximum(a - 1, 0)], n)
        right = np.where(b < n - 1, after[r, np.minimum(b + 1, n - 1)] - b - 1, n)
        return np.minimum(left, right) * self.cell

    def _edges(self, solid: np.ndarray, on_cloth: bool, r: np.ndarray, c: np.ndarray) -> _Edges:
        """Straight lines through both edges of the runs within the pad's width around cells (r, c)."""
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
            cv2.boxFilter(np.asarray(x, np.float32), -1, (1, self.pad), normalize=False, borderType=cv2.BORDER_CONSTANT)[r, c]
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
    """What both pads meet, for n candidates; all (n,)."""

    length: FloatArray  # of contact across the closing direction [m]
    height: FloatArray  # of the lower of both edges [m]
    steep: FloatArray  # share of the contact that does not squeeze the object out
    turn: FloatArray  # by which the closing direction is to be turned [rad]
    wedge: FloatArray  # half the angle between both edges [rad]
    run: FloatArray  # mean distance between the edges [m]
    middle: FloatArray  # between them, column


def _bell(x: FloatArray) -> FloatArray:
    return np.exp(-0.5 * x * x)


def _odd(cells: float) -> int:
    """Nearest odd whole number, so that a filter has a centre."""
    return max(2 * round((cells - 1) / 2) + 1, 1)


def _highest(height: Float32, rows: int, cols: int) -> Float32:
    """Greatest height in a window of (rows, cols) around each cell."""
    return np.asarray(cv2.dilate(height, np.ones((rows, cols), np.uint8)))
