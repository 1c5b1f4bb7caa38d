"""The drop basket beside the workspace."""

from __future__ import annotations

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.scene.scene import Scene

DROPS = ((-0.03, -0.05), (0.03, 0.05), (-0.03, 0.05), (0.03, -0.05), (0.0, 0.0))
"""Places in the basket at which the hand opens, in turn: x, y from its centre [m]. A heap would overflow."""


class Basket:
    """The drop basket of a scene: its place, and what lies in it."""

    def __init__(self, scene: Scene) -> None:
        floor = scene.model.geom("basket/floor")
        self.centre: FloatArray = scene.model.body("basket/body").pos[:2] + floor.pos[:2]
        """World x, y [m]."""
        self._half: FloatArray = np.array(floor.size[:2])

    def holds(self, position: FloatArray) -> bool:
        """Return True if a world position (3,) [m] is in the basket or heaped upon what is."""
        return bool(np.all(np.abs(position[:2] - self.centre) <= self._half) and position[2] > 0)
