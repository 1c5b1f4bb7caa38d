"""Settings of the reaching controllers: Table I, and the figures of published multi-view picking code.

Where the paper is silent, the defaults are the published code's. The paper's own contribution, Algorithm 1,
is two settings: `alpha` and `choice`. This project's own controllers are the presets "robust".
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np

from mpgrasp.controllers.grid_map import EXTENT_PUBLISHED, ROBUST_GRID, GridConfig
from mpgrasp.controllers.information import Border
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import PEAK_QUALITY
from mpgrasp.robot import hand

ALPHA = 0.2
"""Attenuation of Table I."""

Choice = Literal["grid", "pool"]
"""Source of the final grasp: the grid's best cell (eq. 6), or the best pixel of any view (Algorithm 1)."""
Descent = Literal["constant", "coupled"]
"""Vertical speed: `v_z` (Table I), or the rest of `v_1` that horizontal motion leaves (published code)."""


@dataclass(frozen=True, kw_only=True)
class ReachConfig:
    """Settings of one reaching controller; the defaults are those of multi-view picking on Table I's grid."""

    grid: GridConfig = field(default_factory=GridConfig)
    """J, K, u, N_q and N_theta, and the law of the best cell."""
    gamma: float = 0.2 / 0.15
    """Exploration cost [nat/m], "varied" in Table I; published code takes 0.2 nat for every 0.15 m."""
    border: Border = "mirror"
    """Entropy beyond the grid's border, as information gain counts it: published code mirrors the grid there;
    "nothing" is eq. 11 as printed."""
    cost_heights: tuple[float, float] | None = (0.40, 0.55)
    """Heights of the camera over the table between which the exploration cost fades from whole to nothing
    [m], as in published code; None for eq. 13 with the tool point between z_min and z_max."""
    alpha: float = 1.0
    """Attenuation of the horizontal velocity while the quality map has no peak; 1 = none (MVP)."""
    choice: Choice = "grid"
    """Source of the final grasp."""
    descent: Descent = "constant"
    """Law of the vertical speed."""
    v_z: float = 0.05
    """Speed of the descent [m/s]."""
    v_1: float = 0.1
    """Greatest horizontal speed; with the coupled descent, the speed in all [m/s]."""
    window: float = 0.1
    """The best utility is looked for within this distance of the camera, and approached at v_1 from that
    distance on, in proportion below it [m]."""
    peak_threshold: float = PEAK_QUALITY
    """There is a peak where the 3x3 mean of the quality exceeds this; without effect if alpha is 1."""
    z_max: float = 0.50
    """Height of the tcp where the reach begins [m]."""
    z_min: float = 0.175
    """Height of the tcp where the reach ends [m]."""
    min_quality: float = 0.0
    """A grasp of lower quality is not attempted; 0 = whatever was claimed is, as published."""
    yaw_gain: float = 1.0
    """Yaw rate per angle between hand and best grasp [1/s]."""
    yaw_rate_max: float = 0.5
    """Greatest yaw rate [rad/s]."""
    home_yaw: float = 0.0
    """Heading of the tcp's x axis in the arm's home posture [rad]."""
    yaw_range: float = np.pi / 2
    """The hand stays within this of the home heading, moved on where joint 7 would meet its limit [rad]."""
    gripper_open: float = hand.GRIPPER_MAX_WIDTH
    """Opening of the gripper during the reach [m]."""

    def __post_init__(self) -> None:
        positive = ("v_z", "v_1", "window", "gripper_open")
        not_negative = ("gamma", "yaw_gain", "yaw_rate_max")
        for name in positive + not_negative:
            value = getattr(self, name)
            if not np.isfinite(value) or value < 0 or (value == 0 and name in positive):
                raise ConfigError(
                    f"unusable {name}", got=value, allowed="> 0" if name in positive else ">= 0"
                )
        if self.gripper_open > hand.GRIPPER_MAX_WIDTH:
            raise ConfigError(
                "unusable gripper_open",
                got=self.gripper_open,
                allowed=f"up to the hand's {hand.GRIPPER_MAX_WIDTH} m",
            )
        for name in ("alpha", "peak_threshold", "min_quality"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"unusable {name}", got=getattr(self, name), allowed="0 to 1")
        if not 0 < self.z_min < self.z_max:
            raise ConfigError(
                "unusable heights", got=(self.z_min, self.z_max), allowed="0 < z_min < z_max [m]"
            )
        choices = {"border": Border, "choice": Choice, "descent": Descent}
        for name, allowed in ((name, get_args(kind)) for name, kind in choices.items()):
            if getattr(self, name) not in allowed:
                raise ConfigError(f"unknown {name}", got=getattr(self, name), allowed=allowed)
        if self.cost_heights is not None and not 0 <= self.cost_heights[0] < self.cost_heights[1] < np.inf:
            raise ConfigError(
                "unusable cost_heights", got=self.cost_heights, allowed="0 <= lower < upper [m], or none"
            )
        if not np.pi / 2 <= self.yaw_range <= np.pi:
            raise ConfigError(
                "unusable yaw_range", got=self.yaw_range, allowed="pi/2 to pi: any grasp can be met"
            )


MVP = ReachConfig()
"""Multi-view picking as published, on Table I's grid with Table I's descent."""
MPPC = replace(MVP, alpha=ALPHA, choice="pool")
"""Algorithm 1 on the same grid: the paper's difference, and nothing else."""
MVP_ROBUST = ReachConfig(grid=ROBUST_GRID, gamma=8.0, border="nothing", cost_heights=None)
"""This project's own: MVP on `ROBUST_GRID`. On a grid of 0.68 m much stays unseen, and published code's cost
lets that outweigh an object in plain view; with the border mirrored, the arm drifts farther. It asks for no
`min_quality`: where an object is seen late, the many views that claimed nothing keep every mean low."""
MPPC_ROBUST = replace(MVP_ROBUST, alpha=ALPHA)
"""This project's own: attenuation where nothing is seen, and the grasp of the grid, not of any one view."""
OPEN_LOOP = replace(MVP_ROBUST, min_quality=0.1)
"""This project's own: one look from the start height, which may see nothing."""

PRESETS: dict[str, dict[str, ReachConfig]] = {
    "table1": {"mvp": MVP, "mppc": MPPC},
    "published-grid": {
        name: replace(config, grid=GridConfig(extent=EXTENT_PUBLISHED), descent="coupled")
        for name, config in (("mvp", MVP), ("mppc", MPPC))
    },
    "robust": {"mvp": MVP_ROBUST, "mppc": MPPC_ROBUST},
}
"""Named settings of MVP and MP-PC. "table1" and "published-grid" are the two readings of Table I's "J, K: 68
cm": 0.68 m, or the 68 cells (0.34 m) of published code, with that code's descent."""


def preset(name: str, controller: str) -> ReachConfig:
    """Return the named settings of a controller, "mvp" or "mppc".

    Raises:
        ConfigError: there is no such preset, or none for that controller.
    """
    if name not in PRESETS:
        raise ConfigError("unknown controller preset", got=name, allowed=PRESETS)
    if controller not in PRESETS[name]:
        raise ConfigError(f"preset {name} has no such controller", got=controller, allowed=PRESETS[name])
    return PRESETS[name][controller]
