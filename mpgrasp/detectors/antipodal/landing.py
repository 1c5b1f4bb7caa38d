"""Places where the finger tips stop on their way down; the rows of maps run along the closing direction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.detectors.antipodal.windows import Float32, highest, odd
from mpgrasp.geometry import FloatArray

THIN = 0.0025
"""Things that rise less over the tips are grasped at the margin at which they rise most [m]."""
CREST_CLEARANCE = 0.0002
"""Height over a crest of the support at which the tips pass it while they close [m]."""
LOWER = 0.0001
"""Least gain for which a wider margin is taken [m]."""
_NOTHING = np.float32(-1.0)
"""Height lower than any [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Runs:
    """Things to close on, n of them, each a run of columns in a row; all (n,)."""

    row: np.ndarray
    first: np.ndarray  # column
    last: np.ndarray  # column


@dataclass(frozen=True, kw_only=True, eq=False)
class Landing:
    """Heights at which a finger tip stops, for each cell that its centre may stand over."""

    under_finger: Float32
    """(h, w) highest of all that may stop a tip [m]."""
    support: Float32
    """(h, w) highest of the support alone [m]."""
    cell: float
    """Edge of a cell [m]."""
    hand: HandGeometry

    @classmethod
    def on(cls, height: Float32, label: Float32, cell: float, hand: HandGeometry) -> Landing:
        """Return the places on a turned map, heights and labels (h, w)."""
        bare = label == 0
        support = highest(
            np.where(bare, height, _NOTHING), odd(hand.footprint[0] / cell), odd(hand.footprint[1] / cell)
        )
        objects = highest(
            np.where(bare, _NOTHING, height),
            odd((hand.pad_width + hand.play) / cell),
            odd((hand.finger_thickness + 0.002) / cell),
        )
        return cls(under_finger=np.maximum(support, objects), support=support, cell=cell, hand=hand)

    def cut(self, window: tuple[slice, slice]) -> Landing:
        """Return the places in a window of the map."""
        return replace(self, under_finger=self.under_finger[window], support=self.support[window])

    def height(self, runs: Runs, margin: FloatArray) -> FloatArray:
        """Return the height (n,) at which fingers stop that are open by a margin (n,) beside runs [m]."""
        return self._under(self.under_finger, runs, margin) + self.hand.tip_clearance

    def deepest(
        self, runs: Runs, top: FloatArray, margin: FloatArray, free: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the margin and height of the tips (n,) [m] at which thin things are grasped deepest.

        Args:
            runs: n things on the support.
            top: height (n,) of their surface [m].
            margin: usual margin (n,) beside them [m].
            free: free space (n,) beside them [m].
        """
        tips, margin = self.height(runs, margin), margin.copy()
        thin = np.flatnonzero(top - tips < THIN)
        runs = Runs(row=runs.row[thin], first=runs.first[thin], last=runs.last[thin])
        usual, best = margin[thin], np.full(len(thin), np.inf)
        # on the way in, fingers that meet a crest of the support are lifted by it
        crest = self._under(self.support, runs, np.zeros(len(thin)))
        for beside in (usual, *(np.full(len(thin), wider) for wider in self.hand.wider)):
            crest = np.maximum(crest, self._under(self.support, runs, beside))
            height = np.maximum(self.height(runs, beside), crest + CREST_CLEARANCE)
            better = (height < best - LOWER) & ((beside <= free[thin]) | np.isinf(best))
            best[better] = height[better]
            margin[thin[better]] = beside[better]
        tips[thin] = best
        return margin, tips

    def _under(self, heights: Float32, runs: Runs, margin: FloatArray) -> FloatArray:
        """Return the higher of the heights (n,) under both fingers [m]."""
        reach = np.rint((margin + self.hand.finger_thickness / 2) / self.cell).astype(int)
        left = np.maximum(runs.first - reach, 0)
        right = np.minimum(runs.last + reach, heights.shape[1] - 1)
        under: FloatArray = np.maximum(heights[runs.row, left], heights[runs.row, right])
        return under
