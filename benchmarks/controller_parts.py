"""MP-PC with one of its parts taken from MVP, to see which part makes a difference.

To be played by `python -m mpgrasp.bench stacked --controller benchmarks.controller_parts:MppcByMean`.
"""

from __future__ import annotations

from mpgrasp.controllers.mppc import Mppc
from mpgrasp.controllers.mvp import Mvp
from mpgrasp.grasp import Grasp


class MppcByMean(Mppc, Mvp):
    """Moves as MP-PC does, attenuated where nothing is seen, and grasps as MVP does: at the grid map's best
    cell, whose quality is the mean of all views (eq. 6), not at the best pixel of any one view.
    """

    name = "mppc_by_mean"

    def final_grasp(self) -> Grasp | None:
        return Mvp.final_grasp(self)
