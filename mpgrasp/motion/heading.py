"""Heading of the hand for a grasp: a grasp is the same after half a turn, so there are two to choose from."""

from __future__ import annotations

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down, wrap_half_pi
from mpgrasp.grasp import Grasp
from mpgrasp.motion.arm_driver import ArmDriver


def nearest_yaw(angle: float, yaw: float) -> float:
    """The heading [rad] of grasp line `angle` that lies within 90 degrees of heading `yaw`.

    The far one would send differential IK the long way round.
    """
    return yaw + float(wrap_half_pi(angle - yaw))


def reachable_yaw(driver: ArmDriver, grasp: Grasp) -> float:
    """Heading of the hand's x axis [rad]: the nearer one, unless only the other is in reach."""
    T = driver.T_desired
    here = float(np.arctan2(T[1, 0], T[0, 0]))
    near = nearest_yaw(grasp.angle + np.pi / 2, here)
    for yaw in (near, near - np.copysign(np.pi, near - here)):
        try:
            driver.ik.solve(driver.q, looking_down(grasp.position, yaw))
        except ConfigError:
            continue
        return float(yaw)
    # out of reach either way: go as far as the protective stop allows and let it say why
    return near
