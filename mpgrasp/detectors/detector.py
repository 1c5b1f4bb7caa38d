"""What every grasp detector offers: a depth frame in, a grasp map out."""

from __future__ import annotations

from typing import Protocol

from mpgrasp.depth import DepthFrame
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap


class GraspDetector(Protocol):
    """Maps a wrist depth frame to a grasp for every pixel of its own crop of that frame."""

    name: str

    def reset(self, truth: HeightMap) -> None:
        """Start an episode. `truth` is the scene's true shape: the oracle alone may read it."""
        ...

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Grasp map of the frame; quality is zero everywhere where the image says nothing."""
        ...
