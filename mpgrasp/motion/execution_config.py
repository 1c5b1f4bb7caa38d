"""Settings of an execution: speeds, forces, times and heights, and the height that counts as success."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import Grasp
from mpgrasp.robot import hand


@dataclass(frozen=True, kw_only=True)
class ExecutionConfig:
    """Speeds, forces, times and heights by which a grasp is executed and judged."""

    opening_margin: float = 0.01
    """Added to the grasp's width before the descent [m]."""
    approach: float = 0.05
    """Height of the pre-grasp over the grasp [m]."""
    approach_speed: float = 0.25
    """[m/s]"""
    descent_speed: float = 0.05
    """Above the seen surface [m/s]."""
    entry_speed: float = 0.035
    """Below it, where the fingers pass between objects and may land on one [m/s]."""
    entry_height: float = 0.005
    """Height of the finger tips over the seen surface at which that begins [m]."""
    guarded_speed: float = 0.02
    """Speed of the last millimetres, where contact with the support is expected [m/s]."""
    guarded_height: float = 0.010
    """Height of the finger tips over the table at which those begin [m]."""
    support_band: float = 0.006
    """Contact below this height of the tips is with the support, above it with an object [m]; unless the
    plan itself ends higher."""
    contact_threshold: float = 3.0
    """Force that counts as contact [N]."""
    force_noise: float = 0.0
    """Standard deviation of white noise on each axis of the force that is felt, in every tick of the
    velocity loop [N]: forces are estimated from the torques at the joints."""
    contact_deceleration: float = 1.5
    """Braking at contact [m/s2]."""
    back_off: float = 0.0005
    """Rise after contact, so that the tips do not press on the support while they close [m]."""
    palm_depth: float = 0.042
    """Deepest reach of the tips below the seen surface [m]; the palm is 45 mm above them."""
    overtravel: float = 0.002
    """Depth below the table's plane to which the search for contact may go [m]."""
    grip_force: float = hand.GRIPPER_FORCE_DEFAULT
    """Force of each pad [N]."""
    settle_time: float = 2.5
    """Longest wait for the gripper to come to rest [s]."""
    lift: float = 0.15
    """[m]"""
    lift_speed: float = 0.1
    """[m/s]"""
    hold_time: float = 1.0
    """[s]"""
    shake_amplitude: float = 0.005
    """[m]"""
    shake_frequency: float = 3.0
    """[Hz]; with the amplitude, peaks of 1.8 m/s2."""
    shake_time: float = 0.7
    """Duration of each of the two shakes, sideways and up and down [s]; 0 = not shaken."""
    settle_after_shake: float = 0.2
    """[s]"""
    success_height: float = 0.05
    """Rise of an object over its place of rest that counts as lifted [m]."""

    def planned_height(self, grasp: Grasp) -> float:
        """Return the height of the finger tips over the table that is aimed at [m].

        It is no deeper than the palm allows, nor than the table.
        """
        return max(-self.overtravel, float(grasp.position[2]) - self.palm_depth)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ConfigError(f"{name} must be finite and not negative", got=value)
        for name in (
            "approach_speed",
            "descent_speed",
            "entry_speed",
            "guarded_speed",
            "lift_speed",
            "lift",
        ):
            if getattr(self, name) == 0:
                raise ConfigError(f"{name} must be positive", got=0)
        if self.success_height >= self.lift:
            raise ConfigError("success_height must be less than the lift", got=self.success_height)
        if not hand.GRIPPER_FORCE_MIN <= self.grip_force <= hand.GRIPPER_FORCE_MAX:
            raise ConfigError(
                "grip force out of range",
                got=self.grip_force,
                allowed=f"{hand.GRIPPER_FORCE_MIN} to {hand.GRIPPER_FORCE_MAX} N",
            )
