"""MP-PC, the paper's multi-view perceptual planning controller (Algorithm 1), and this project's robust one.

Algorithm 1 exists in the paper alone: the authors' public code is the published multi-view picking code with
a class renamed, without alpha, without exist_peak() and without the pool B.
"""

from __future__ import annotations

from mpgrasp.controllers.config import MPPC, MPPC_ROBUST
from mpgrasp.controllers.reaching import ReachingController


class Mppc(ReachingController):
    """Moves sideways at alpha of the speed while the quality map has no peak, and in the end takes the
    best of the pool B, which holds the best grasp of every view.
    """

    name = "mppc"
    defaults = MPPC


class MppcRobust(ReachingController):
    """Attenuates as MP-PC does, on the robust grid, and grasps at that grid's best cell: the mean of all
    views is less often too good to be true than the best pixel of any one view.
    """

    name = "mppc_robust"
    defaults = MPPC_ROBUST
