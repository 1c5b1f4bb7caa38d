"""MVP, the baseline: multi-view picking as it was published, and on this project's robust grid.

Reference: Morrison et al., Multi-View Picking: Next-best-view Reaching for Improved Grasping in Clutter,
ICRA 2019.
"""

from __future__ import annotations

from mpgrasp.controllers.config import MVP, MVP_ROBUST
from mpgrasp.controllers.reaching import ReachingController


class Mvp(ReachingController):
    """Follows the utility at full speed whatever the detector sees, and grasps at the grid's best cell."""

    name = "mvp"
    defaults = MVP


class MvpRobust(ReachingController):
    """The same on the robust grid, which does not take a cell that was hardly seen for a good one."""

    name = "mvp_robust"
    defaults = MVP_ROBUST
