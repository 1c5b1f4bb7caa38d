"""MVP, the baseline: multi-view picking without attenuation, which grasps at the grid map's best cell.

Reference: Morrison et al., Multi-View Picking: Next-best-view Reaching for Improved Grasping in Clutter,
ICRA 2019.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpgrasp.controllers.reaching import ReachingController
from mpgrasp.grasp import Grasp, GraspMap


class Mvp(ReachingController):
    """Follows the utility at full speed whatever the detector sees."""

    name = "mvp"

    def final_grasp(self) -> Grasp | None:
        """Eq. 6 of the cell with the highest mean quality."""
        best = self.grid.best_grasp()
        return best if best is not None and best.quality >= self.config.min_quality else None

    def _look(self, grasp_map: GraspMap, cells: NDArray[np.intp]) -> None:
        """All that MVP knows is in the grid."""

    def _attenuation(self, peak: bool) -> float:
        return 1.0
