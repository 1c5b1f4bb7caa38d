"""The floor of the controllers: straight down, without a look to the side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpgrasp.controllers.config import MPPC_ROBUST
from mpgrasp.controllers.controller import Command, Observation
from mpgrasp.controllers.reaching import ReachingController


class StraightDown(ReachingController):
    """Fuses what it sees as robust MP-PC does, turns the hand and goes down, and never moves sideways."""

    name = "straight_down"
    defaults = MPPC_ROBUST
    reads = (
        "grid", "choice", "v_z", "z_min", "min_quality", "yaw_gain", "yaw_rate_max", "home_yaw", "yaw_range",
        "gripper_open",
    )  # fmt: skip
    """Settings that have an effect on it."""

    def update(self, observation: Observation) -> Command:
        command = super().update(observation)
        if command.done:
            return command
        return replace(command, twist=np.array([0.0, 0.0, -self.config.v_z, *command.twist[3:]]))
