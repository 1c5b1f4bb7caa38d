"""Settings of the differential inverse kinematics: weights and limits of its quadratic program."""

from __future__ import annotations

from dataclasses import dataclass

from mpgrasp.exceptions import ConfigError


@dataclass(frozen=True, kw_only=True)
class IkConfig:
    """Weights and limits of the quadratic program."""

    damping: float = 1e-7
    """Levenberg-Marquardt damping. So small that it costs less than 0.01 % of a motion at a singular
    value of 0.05: near a singularity the velocity grows until a reflex names it."""
    posture_cost: float = 1e-2
    """Weight of the elbow posture against 1 for the tool pose: enough for the null space only."""
    posture_rate: float = 0.2
    """Rate at which the elbow swings home within the null space [1/s]."""
    posture_smoothing: float = 0.5
    """Time constant with which that motion sets in, so that it starts without a jerk [s]."""
    joint_margin: float = 0.01
    """Distance that the commanded position keeps from the joint limits [rad]."""
    velocity_fraction: float = 1.0
    """Share of the FER's joint velocity that the program may use."""
    collision_distance: float = 0.01
    """Least distance between hand and own arm, and between hand and table [m]."""
    collision_range: float = 0.05
    """Distance at which collision limits set in [m]."""
    collision_rate: float = 10.0
    """Approach to `collision_distance` slows down at this rate [1/s]."""
    collisions: bool = True
    """True to avoid collisions at all."""

    def __post_init__(self) -> None:
        for name in ("damping", "posture_cost", "posture_rate", "joint_margin"):
            if getattr(self, name) < 0:
                raise ConfigError(f"{name} must not be negative", got=getattr(self, name))
        for name in ("posture_smoothing", "collision_rate"):
            if getattr(self, name) <= 0:
                raise ConfigError(f"{name} must be positive", got=getattr(self, name))
        if not 0 < self.velocity_fraction <= 1:
            raise ConfigError("velocity_fraction is a share", got=self.velocity_fraction, allowed="(0, 1]")
        if not 0 < self.collision_distance < self.collision_range:
            raise ConfigError(
                "collision_distance must lie within collision_range",
                got=self.collision_distance,
                allowed=f"(0, {self.collision_range})",
            )
