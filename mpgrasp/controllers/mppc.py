"""MP-PC, the paper's multi-view perceptual planning controller (Algorithm 1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpgrasp.controllers.grid_map import GridMap
from mpgrasp.controllers.reaching import ReachingController
from mpgrasp.grasp import Grasp, GraspMap, best_pixel


class Mppc(ReachingController):
    """Moves sideways at alpha of the speed while the quality map has no peak, and in the end takes the
    best of the pool B, which holds the best grasp of every view.
    """

    name = "mppc"

    def reset(self, seed: int) -> None:
        super().reset(seed)
        self.pool: list[Grasp] = []

    def final_grasp(self) -> Grasp | None:
        """Line 17: the best grasp of the pool; of equals the latest, which was seen from nearest by."""
        best = max(reversed(self.pool), key=lambda grasp: grasp.quality, default=None)
        return best if best is not None and best.quality >= self.config.min_quality else None

    def _look(self, grasp_map: GraspMap, cells: NDArray[np.intp]) -> None:
        grasp = best_grasp_in_view(grasp_map, cells, self.grid)
        if grasp is not None:
            self.pool.append(grasp)

    def _attenuation(self, peak: bool) -> float:
        return 1.0 if peak else self.config.alpha


def best_grasp_in_view(grasp_map: GraspMap, cells: NDArray[np.intp], grid: GridMap) -> Grasp | None:
    """Lines 11-14: the grasp of the best pixel whose point lies in the workspace; None where none does.

    `cells` (H, W) is what `GridMap.update` returned for this view. Quality is lowered around remembered
    failures.
    """
    if (cells < 0).all():
        return None
    quality = grasp_map.quality
    if grid.failures.any():
        quality = quality - grid.failures.ravel()[cells]
    row, col = best_pixel(np.where(cells >= 0, quality, -np.inf))
    return replace(grasp_map.grasp_at(row, col), quality=float(np.clip(quality[row, col], 0.0, 1.0)))
