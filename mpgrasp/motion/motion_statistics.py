"""Figures of the arm's motion, gathered tick by tick: path, closeness to singularities, jerk, wall time."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import norm
from mpgrasp.motion.ik_solution import IkSolution
from mpgrasp.motion.trajectory import MotionConfig


@dataclass(frozen=True, kw_only=True)
class MotionStatistics:
    """Figures of the arm's motion since the driver was reset."""

    duration: float
    """Simulated time [s]."""
    path_length: float
    """Length of the measured tool point's path [m]."""
    min_singular_value: float
    """Smallest singular value of the tool Jacobian so far."""
    near_singularity: float
    """Time spent below the warning level [s]."""
    max_acceleration: float
    """Largest commanded acceleration of the tool point [m/s2]."""
    max_joint_acceleration: FloatArray
    """(7,) largest commanded accelerations [rad/s2]."""
    max_joint_velocity: FloatArray
    """(7,) largest demanded velocities [rad/s]."""
    jerk_rms: float
    """Root mean square jerk of the measured tool point at the loop's rate [m/s3]."""
    max_tracking_error: float
    """Largest distance from desired to measured tool point [m]."""
    ik_seconds: float
    """Wall time spent in IK [s]."""
    physics_seconds: float
    """Wall time spent in physics [s]."""


class MotionMeter:
    """Gathers the figures of one motion that starts at rest.

    Args:
        config: period of the loop, and the level at which a singularity counts as near.
        time: simulated time at the start [s].
        position: (3,) measured tool point at the start [m].
        min_singular_value: of the tool Jacobian at the start.
    """

    def __init__(
        self, config: MotionConfig, time: float, position: FloatArray, min_singular_value: float
    ) -> None:
        self.twist: FloatArray = np.zeros(6)
        """(6,) twist that the last tick asked for, world axes [m/s, rad/s]."""
        self.ik_seconds = self.physics_seconds = 0.0
        self._config, self._start = config, time
        self._dq: FloatArray = np.zeros(7)
        self._velocities: deque[FloatArray] = deque(maxlen=3)
        self._position = np.array(position)
        self._path_length = self._jerk_sum = self._near = 0.0
        self._jerk_count = 0
        self._max_acceleration = self._max_tracking = 0.0
        self._max_ddq, self._max_dq = np.zeros(7), np.zeros(7)
        self._min_singular_value = min_singular_value

    def observe(
        self, twist: FloatArray, solution: IkSolution, position: FloatArray, desired: FloatArray,
        velocity: FloatArray,
    ) -> None:  # fmt: skip
        """Take in one tick.

        Args:
            twist: (6,) asked for, world axes [m/s, rad/s].
            solution: what IK made of it.
            position: (3,) measured tool point at the end of the tick [m].
            desired: (3,) where it should be [m].
            velocity: (3,) measured velocity of the tool point [m/s].
        """
        dt = self._config.dt
        acceleration = norm(twist[:3] - self.twist[:3]) / dt
        self._max_acceleration = max(self._max_acceleration, acceleration)
        self.twist = twist
        self._max_ddq = np.maximum(self._max_ddq, np.abs(solution.dq - self._dq) / dt)
        self._max_dq = np.maximum(self._max_dq, np.abs(solution.demanded_dq))
        self._dq = solution.dq
        self._min_singular_value = min(self._min_singular_value, solution.min_singular_value)
        self._near += dt * (solution.min_singular_value < self._config.singularity_warning)
        self._path_length += norm(position - self._position)
        self._position = np.array(position)
        self._max_tracking = max(self._max_tracking, norm(position - desired))
        self._velocities.append(np.array(velocity))
        if len(self._velocities) == 3:
            a, b, d = self._velocities
            self._jerk_sum += norm(a - 2 * b + d) ** 2 / dt**4
            self._jerk_count += 1

    def statistics(self, time: float) -> MotionStatistics:
        """Figures up to now, at a simulated time [s]."""
        return MotionStatistics(
            duration=time - self._start,
            path_length=self._path_length,
            min_singular_value=self._min_singular_value,
            near_singularity=self._near,
            max_acceleration=self._max_acceleration,
            max_joint_acceleration=self._max_ddq.copy(),
            max_joint_velocity=self._max_dq.copy(),
            jerk_rms=float(np.sqrt(self._jerk_sum / self._jerk_count)) if self._jerk_count else 0.0,
            max_tracking_error=self._max_tracking,
            ik_seconds=self.ik_seconds,
            physics_seconds=self.physics_seconds,
        )
