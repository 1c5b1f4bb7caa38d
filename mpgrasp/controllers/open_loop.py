"""Open loop: one look from where the arm starts, then the best grasp of that view."""

from __future__ import annotations

import numpy as np

from mpgrasp.controllers.config import OPEN_LOOP, ReachConfig
from mpgrasp.controllers.controller import Command, Observation
from mpgrasp.controllers.grid_map import GridMap
from mpgrasp.controllers.reaching import best_grasp_in_view
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, peak_height


class OpenLoop:
    """Is done after its first view and never moves the arm."""

    name = "open_loop"
    defaults = OPEN_LOOP
    reads = ("grid", "min_quality", "gripper_open")
    """Settings that have an effect on it."""

    def __init__(self, config: ReachConfig | None = None) -> None:
        self.config = config or self.defaults
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Forget the last view; nothing here is random, so that `seed` changes nothing."""
        self.grid = GridMap(self.config.grid)
        self._grasp: Grasp | None = None
        self._seen = False
        self._diagnostics: dict[str, FloatArray | float | bool] = {}

    def remember_failure(self, position: FloatArray) -> None:
        """Lower quality around a failed grasp at world (3,) [m]; to be told anew after each `reset`."""
        self.grid.suppress(position)

    def update(self, observation: Observation) -> Command:
        if not self._seen:
            grasp_map = observation.grasp_map
            self._grasp = best_grasp_in_view(grasp_map, self.grid.update(grasp_map), self.grid)
            self._seen = True
            self._diagnostics = {
                "mean_quality": self.grid.mean_quality(),
                "peak_height": peak_height(grasp_map.quality),
                "best_quality": 0.0 if self._grasp is None else self._grasp.quality,
            }
        return Command(twist=np.zeros(6), gripper=self.config.gripper_open, done=True)

    def final_grasp(self) -> Grasp | None:
        """The best grasp of the one view."""
        enough = self._grasp is not None and self._grasp.quality >= self.config.min_quality
        return self._grasp if enough else None

    def diagnostics(self) -> dict[str, FloatArray | float | bool]:
        return dict(self._diagnostics)
