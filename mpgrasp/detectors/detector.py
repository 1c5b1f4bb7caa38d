"""The protocol of every grasp detector: a depth frame in, a grasp map out."""

from __future__ import annotations

from typing import Protocol

from mpgrasp.depth import DepthFrame
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap


class GraspDetector(Protocol):
    """Maps a wrist depth frame to a grasp for every pixel of its own crop of that frame."""

    name: str

    def reset(self, truth: HeightMap | None) -> None:
        """Start an episode. `truth` is the true shape for a detector that `reads_truth`, else None."""
        ...

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Return the grasp map of the frame; quality is zero everywhere where the image says nothing."""
        ...


def reads_truth(detector: GraspDetector) -> bool:
    """True if the detector declares, by `reads_truth = True`, that it is told the scene's true shape.

    The benchmark writes it into run.json: such a detector is a ceiling, not a competitor.
    """
    return bool(getattr(detector, "reads_truth", False))


def reads_colour(detector: GraspDetector) -> bool:
    """True if the detector declares, by `reads_colour = True`, that its frames must have colour."""
    return bool(getattr(detector, "reads_colour", False))


def prepare(detector: GraspDetector) -> str | None:
    """Let a detector that compiles something do it now, and return a line that says what it took.

    Such a detector offers `warm_up()`, which returns seconds, and `readiness`, the line. None of all others.
    """
    if not hasattr(detector, "warm_up"):
        return None
    detector.warm_up()
    return str(getattr(detector, "readiness", "")) or None
