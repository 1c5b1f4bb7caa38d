"""A detector that is tried, and its views of boxes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from mpgrasp.check.laws import Skipped
from mpgrasp.check.solids import Box, frame, truth
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import GraspDetector, prepare, reads_colour, reads_truth
from mpgrasp.grasp import Grasp, GraspMap, best_pixel
from mpgrasp.guards.asking import ask_detector
from mpgrasp.height_map import HeightMap

HEIGHTS = (0.55, 0.42, 0.29)
"""Heights of the camera over the table in a reach: at its beginning, in its middle and near its end [m]."""
CLAIMED = 0.1
"""A best quality of less claims nothing that could be checked."""
BOX = Box(yaw=0.3, length=0.06, breadth=0.03, height=0.03)
"""A box of the size of a matchbox, in the middle of the image."""
BAR = Box(x=0.525, y=0.035, yaw=0.6, length=0.1, breadth=0.03, height=0.02)
"""A bar that a hand can close on across its breadth alone, off the middle of the image."""


@dataclass(kw_only=True)
class DetectorSubject:
    """A detector, and how another of its kind is made."""

    make: Callable[[], GraspDetector]
    detector: GraspDetector
    truths: dict[tuple[Box, ...], HeightMap] = field(default_factory=dict)
    grasps: dict[tuple[Box, float, float], Grasp] = field(default_factory=dict)
    """The best grasps so far, which several laws look at: by box, height and yaw."""

    @classmethod
    def of(cls, make: Callable[[], GraspDetector]) -> DetectorSubject:
        """Return what is tried, ready to look at frames."""
        made = make()
        prepare(made)
        return cls(make=make, detector=made)

    def frame(self, *boxes: Box, height: float = HEIGHTS[1], yaw: float = 0.0) -> DepthFrame:
        """Return what the camera sees, with colour where the detector reads it."""
        return frame(*boxes, height=height, yaw=yaw, colour=reads_colour(self.detector))

    def reset(self, *boxes: Box, detector: GraspDetector | None = None) -> None:
        """Begin an episode with boxes."""
        detector = detector or self.detector
        if reads_truth(detector) and boxes not in self.truths:
            self.truths[boxes] = truth(boxes)
        detector.reset(self.truths[boxes] if reads_truth(detector) else None)

    def look(self, *boxes: Box, height: float = HEIGHTS[1], yaw: float = 0.0) -> GraspMap:
        """Begin an episode and return the map of its first frame."""
        self.reset(*boxes)
        return ask_detector(self.detector, self.frame(*boxes, height=height, yaw=yaw))

    def best(self, box: Box, *, height: float = HEIGHTS[1], yaw: float = 0.0) -> Grasp:
        """Return the best grasp in a view of a lone box.

        Raises:
            Skipped: it claims hardly any.
        """
        if (box, height, yaw) not in self.grasps:
            self.grasps[box, height, yaw] = self._best(box, height, yaw)
        return self.grasps[box, height, yaw]

    def _best(self, box: Box, height: float, yaw: float) -> Grasp:
        view = self.look(box, height=height, yaw=yaw)
        row, col = best_pixel(view.quality)
        if view.quality[row, col] < CLAIMED:
            raise Skipped(
                f"it claims no grasp on a plain box (best quality {view.quality[row, col]:.2g}, seen from "
                f"{height:g} m), so there is nothing to check"
            )
        return view.grasp_at(row, col)


def different(first: GraspMap, second: GraspMap) -> str | None:
    """Return in words where two maps differ; None where they are equal bit for bit."""
    for name in ("quality", "angle", "width"):
        a, b = getattr(first, name), getattr(second, name)
        if a.shape != b.shape:
            return f"{name} has the size {a.shape} and then {b.shape}"
        if not np.array_equal(a, b):
            count, most = int((a != b).sum()), float(np.abs(a - b).max())
            return f"{name} differs in {count} of {a.size} pixels, by up to {most:.3g}"
    return None


def boxes_in_rows() -> Sequence[Box]:
    """Return boxes of many heights all over the image: a wrong geometry shows."""
    places = [(x, y) for x in (-0.12, -0.04, 0.04, 0.12) for y in (-0.12, -0.04, 0.04, 0.12)]
    return [
        Box(x=0.5 + x, y=y, length=0.045, breadth=0.04, height=0.02 + 0.006 * k)
        for k, (x, y) in enumerate(places)
    ]
