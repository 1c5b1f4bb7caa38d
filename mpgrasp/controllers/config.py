"""Settings of the reaching controllers: Table I, and what published multi-view picking code adds to it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mpgrasp.controllers.grid_map import EXTENT_PUBLISHED, GridConfig
from mpgrasp.controllers.information import Border
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import PEAK_QUALITY
from mpgrasp.robot import hand


@dataclass(frozen=True, kw_only=True)
class MppcConfig:
    """One set of settings for MP-PC, MVP and open loop, so that a comparison changes nothing else."""

    grid: GridConfig = field(default_factory=GridConfig)
    """J, K, u, N_q and N_theta."""
    prior_count: float = 1.0
    """Count that every (angle, quality) bin starts with: what makes unseen cells the most uncertain."""
    gamma: float = 8.0
    """Exploration cost [nat/m], "varied" in Table I. On a grid of 0.68 m much stays unseen, and the 4/3 of
    published code (0.2 nat for every 0.15 m, on 0.34 m) lets that outweigh an object in plain view."""
    border: Border = "nothing"
    """Entropy beyond the grid's border, as information gain counts it. "nothing" is eq. 11 as printed; with
    "mirror" the arm drifts farther when it sees nothing, on the 0.68 m grid to the end of its reach."""
    v_z: float = 0.05
    """Speed of the descent [m/s]."""
    v_1: float = 0.1
    """Greatest horizontal speed [m/s]."""
    window: float = 0.1
    """The best utility is looked for within this distance of the camera, and approached at v_1 from that
    distance on, in proportion below it [m]."""
    alpha: float = 0.2
    """Attenuation of the horizontal velocity while the quality map has no peak; MP-PC only."""
    peak_threshold: float = PEAK_QUALITY
    """There is a peak where the 3x3 mean of the quality exceeds this; MP-PC only."""
    z_max: float = 0.50
    """Height of the tcp where the reach begins [m]."""
    z_min: float = 0.175
    """Height of the tcp where the reach ends [m]."""
    min_quality: float = 0.1
    """A grasp of lower quality is not attempted."""
    yaw_gain: float = 1.0
    """Yaw rate per angle between hand and best grasp [1/s]."""
    yaw_rate_max: float = 0.5
    """Greatest yaw rate [rad/s]."""
    home_yaw: float = 0.0
    """Heading of the tcp's x axis in the arm's home posture [rad]."""
    yaw_range: float = np.pi / 2
    """The hand stays within this of the home heading, well within the range of joint 7 [rad]."""
    gripper_open: float = hand.GRIPPER_MAX_WIDTH
    """Opening of the gripper during the reach [m]."""

    def __post_init__(self) -> None:
        positive = ("v_z", "v_1", "window", "gripper_open")
        not_negative = ("prior_count", "gamma", "yaw_gain", "yaw_rate_max")
        for name in positive + not_negative:
            value = getattr(self, name)
            if not np.isfinite(value) or value < 0 or (value == 0 and name in positive):
                raise ConfigError(
                    f"unusable {name}", got=value, allowed="> 0" if name in positive else ">= 0"
                )
        for name in ("alpha", "peak_threshold", "min_quality"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"unusable {name}", got=getattr(self, name), allowed="0 to 1")
        if not 0 < self.z_min < self.z_max:
            raise ConfigError(
                "unusable heights", got=(self.z_min, self.z_max), allowed="0 < z_min < z_max [m]"
            )
        if self.border not in ("nothing", "mirror"):
            raise ConfigError("unknown border", got=self.border, allowed=("nothing", "mirror"))
        if not np.pi / 2 <= self.yaw_range <= np.pi:
            raise ConfigError(
                "unusable yaw_range", got=self.yaw_range, allowed="pi/2 to pi: any grasp can be met"
            )


PRESETS: dict[str, MppcConfig] = {
    "paper": MppcConfig(),
    "published": MppcConfig(grid=GridConfig(extent=EXTENT_PUBLISHED), border="mirror", gamma=0.2 / 0.15),
}
"""The two readings of Table I's "J, K: 68 cm": 0.68 m, or the 68 cells (0.34 m) of published code."""


def preset(name: str) -> MppcConfig:
    """Return the named settings.

    Raises:
        ConfigError: there is no such preset.
    """
    if name not in PRESETS:
        raise ConfigError("unknown controller preset", got=name, allowed=PRESETS)
    return PRESETS[name]
