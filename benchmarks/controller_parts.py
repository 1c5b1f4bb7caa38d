"""MP-PC with one of its parts taken from MVP, to see which part makes a difference.

To be played by `python -m mpgrasp.bench stacked --controller benchmarks.controller_parts:MppcByMean`.
"""

from __future__ import annotations

from mpgrasp.controllers.mppc import MppcRobust


class MppcByMean(MppcRobust):
    """`mppc_robust`, by the name that published runs know it by."""

    name = "mppc_by_mean"
