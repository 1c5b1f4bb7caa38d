"""Heading of the hand for a grasp: a grasp is the same after half a turn, so there are two to choose from."""

from __future__ import annotations

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down, wrap_half_pi
from mpgrasp.grasp import Grasp
from mpgrasp.linear_algebra import norm
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.time_scaling import rehearse
from mpgrasp.motion.trajectory import pose_error
from mpgrasp.robot import hand

SPARE = 0.05
"""Room that every joint is to keep to the margin of differential IK on the way to a grasp [rad]: the elbow's
swing home is not in the plan, and from 0.015 rad on IK brakes a wrist that turns at 1.5 rad/s."""
STEP_LENGTH = 0.04
"""Greatest way of the tool between two looks at the joints [m]."""
STEP_ANGLE = 0.15
"""Greatest turn of the tool between two looks at the joints [rad]."""


def nearest_yaw(angle: float, yaw: float) -> float:
    """Return the heading [rad] of grasp line `angle` that lies within 90 degrees of heading `yaw`.

    The far one would send differential IK the long way round.
    """
    return yaw + float(wrap_half_pi(angle - yaw))


def reachable_yaw(driver: ArmDriver, grasp: Grasp, config: ExecutionConfig | None = None) -> float:
    """Return the heading of the hand's x axis [rad]: the nearer one, unless only the other is in reach.

    A heading is in reach if IK finds a posture at the grasp, and if the whole way there, turn included, keeps
    every joint clear of the margin at which differential IK would have to change its answer. Where neither
    does, as over the table's near edge, where the elbow is folded, it is the one that comes less close.
    """
    config = config or ExecutionConfig()
    T = driver.T_desired
    here = float(np.arctan2(T[1, 0], T[0, 0]))
    near = nearest_yaw(grasp.angle + np.pi / 2, here)
    headings = (near, float(near - np.copysign(np.pi, near - here)))
    spare: dict[float, float] = {}
    for yaw in headings:
        if not _has_posture(driver, grasp, yaw):
            continue
        spare[yaw] = _spare_room(driver, grasp, config, yaw)
        if spare[yaw] >= -1e-9:
            return yaw
    # out of reach either way: go as far as the protective stop allows and let it say why
    return max(spare, key=spare.__getitem__, default=near)


def _has_posture(driver: ArmDriver, grasp: Grasp, yaw: float) -> bool:
    """True if IK finds joint positions at the grasp."""
    try:
        driver.ik.solve(driver.q, looking_down(grasp.position, yaw))
    except ConfigError:
        return False
    return True


def _spare_room(driver: ArmDriver, grasp: Grasp, config: ExecutionConfig, yaw: float) -> float:
    """Return the least room beyond `SPARE` that the way to the grasp and up again leaves a joint [rad].

    Of a joint that is closer to its margin already, the room beyond what it has now.
    """
    ik, q, T = driver.ik, np.array(driver.q, float), driver.T_desired
    needed, least = np.minimum(SPARE, ik.room(q)), np.inf
    for target in _way(T, grasp, config, yaw):
        error = pose_error(T, target)
        steps = max(norm(error[:3]) / STEP_LENGTH, norm(error[3:]) / STEP_ANGLE)
        shares = np.linspace(0.0, 1.0, int(np.ceil(steps)) + 1)[1:]
        path = rehearse(ik, q, T, error, shares)
        least = min(least, float(np.min(ik.room(path) - needed, initial=np.inf)))
        q, T = (path[-1] if len(path) else q), target
    return least


def _way(T: FloatArray, grasp: Grasp, config: ExecutionConfig, yaw: float) -> list[FloatArray]:
    """Poses (4, 4) between which the phases of an execution move in straight lines."""
    x, y, z = (float(value) for value in grasp.position)
    above, down = z + config.approach, config.planned_height(grasp) + hand.FINGERTIP_BEYOND_TCP
    risen = T.copy()
    risen[2, 3] = max(float(T[2, 3]), above)
    heights = (above, down, down + config.lift)
    return [risen, *(looking_down([x, y, height], yaw) for height in heights)]
