"""The 100 Hz velocity loop: twists and straight-line moves of the arm under protective stops.

Every motion is a sequence of desired tool poses, one per tick of 10 ms. Differential IK follows the
desired pose on the commanded joint positions, not on the measured ones, so neither servo lag nor
contact makes it drift; a reflex watches the distance between both.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.motion.ik import DifferentialIK, IkSolution
from mpgrasp.motion.reflex import MeasuredArm, Reflex, ReflexMonitor
from mpgrasp.motion.time_scaling import scaled_profile
from mpgrasp.motion.trajectory import MotionConfig, TwistRamp, integrate_pose, pose_error
from mpgrasp.scene.simulation import Simulation

FORCE_WINDOW = 5
"""Ticks over which the external force is averaged before it can stop the arm. The arm weighs some 20 kg as
seen from the tool; touching a hard table at 0.05 m/s is 1 N s, 100 N over one tick, and breaks nothing."""


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


OnTick = Callable[["ArmDriver"], None]


class ArmDriver:
    """Drives the simulated arm: ramp -> IK -> joint targets -> physics -> reflex, every 10 ms.

    A reflex stops the arm where it is; later motions return it at once and do not move.
    """

    def __init__(
        self,
        simulation: Simulation,
        config: MotionConfig | None = None,
        ik: DifferentialIK | None = None,
        monitor: ReflexMonitor | None = None,
    ) -> None:
        self.simulation = simulation
        self.config = config or MotionConfig()
        self.ik = ik or DifferentialIK()
        self.monitor = monitor or ReflexMonitor()
        self.ramp = TwistRamp(self.config)
        self.steps_per_tick = round(self.config.dt / simulation.model.opt.timestep)
        if abs(self.steps_per_tick * simulation.model.opt.timestep - self.config.dt) > 1e-9:
            raise ConfigError(
                "the loop's period must be a multiple of the simulation's",
                got=self.config.dt,
                allowed=f"multiples of {simulation.model.opt.timestep:g} s",
            )
        self.reset()

    def reset(self) -> None:
        """Start anew from where the arm is, at rest."""
        self.ik.reset()
        self.monitor.reset()
        self.ramp.reset()
        self.q = np.array(self.simulation.q, float)
        self.T_desired = self.ik.pose(self.q)
        self.solution: IkSolution | None = None
        self._start = self.simulation.time
        self._dq: FloatArray = np.zeros(7)
        self._twist: FloatArray = np.zeros(6)
        self._forces: deque[FloatArray] = deque([np.zeros(3)] * FORCE_WINDOW, maxlen=FORCE_WINDOW)
        self._velocities: deque[FloatArray] = deque(maxlen=3)
        self._position = np.array(self.simulation.T_world_tcp[:3, 3])
        self._path_length = self._jerk_sum = self._near = 0.0
        self._jerk_count = 0
        self._max_acceleration = self._max_tracking = 0.0
        self._max_ddq, self._max_dq = np.zeros(7), np.zeros(7)
        self._min_singular_value = float(np.linalg.svd(self.ik.jacobian(self.q), compute_uv=False)[-1])
        self._ik_seconds = self._physics_seconds = 0.0

    @property
    def reflex(self) -> Reflex | None:
        """The stop that ended the motion, if any."""
        return self.monitor.reflex

    @property
    def twist_commanded(self) -> FloatArray:
        """(6,) twist that the last tick asked for, world axes [m/s, rad/s]."""
        return self._twist

    @property
    def twist_achieved(self) -> FloatArray:
        """(6,) measured twist, world axes [m/s, rad/s]."""
        return self.simulation.twist_tcp

    @property
    def touch(self) -> float:
        """External force on the robot over the last tick [N]: exact and instant, for feeling the way."""
        return float(np.linalg.norm(self._forces[-1]))

    @property
    def external_force(self) -> float:
        """External force on the robot, mean over `FORCE_WINDOW` ticks [N]: what a stop is judged by."""
        return float(np.linalg.norm(np.mean(self._forces, axis=0)))

    @property
    def min_singular_value(self) -> float:
        """Smallest singular value of the tool Jacobian, now; NaN before the first tick."""
        return np.nan if self.solution is None else self.solution.min_singular_value

    @property
    def manipulability(self) -> float:
        """Manipulability of the tool Jacobian, now; NaN before the first tick."""
        return np.nan if self.solution is None else self.solution.manipulability

    def drive(self, twist: FloatArray, duration: float, on_tick: OnTick | None = None) -> Reflex | None:
        """Follow a twist (6,), world axes [m/s, rad/s], for a time [s]; it ramps, and moves on."""
        for _ in range(round(duration / self.config.dt)):
            self._tick(integrate_pose(self.T_desired, self.ramp.step(twist), self.config.dt), on_tick)
            if self.reflex is not None:
                break
        return self.reflex

    def stop(self, on_tick: OnTick | None = None, *, deceleration: float | None = None) -> Reflex | None:
        """Come to rest: along the ramp, or at once with a deceleration [m/s2]."""
        c = self.config
        while np.any(self.ramp.twist != 0) and self.reflex is None:
            if deceleration is None:
                self.drive(np.zeros(6), c.dt, on_tick)
                continue
            twist = self.ramp.twist
            linear = float(np.linalg.norm(twist[:3]))
            keep = max(0.0, 1.0 - deceleration * c.dt / linear) if linear > 0 else 0.0
            self.ramp.reset(twist * keep)
            self._tick(integrate_pose(self.T_desired, self.ramp.twist, c.dt), on_tick)
        return self.reflex

    def wait(
        self, duration: float, on_tick: OnTick | None = None, *, until: Callable[[], bool] | None = None
    ) -> Reflex | None:
        """Stand still for a time [s], or until something holds."""
        self.stop(on_tick)
        for _ in range(round(duration / self.config.dt)):
            if self.reflex is not None or (until is not None and until()):
                break
            self._tick(self.T_desired, on_tick)
        return self.reflex

    def move_to(
        self,
        T_world_tcp: FloatArray,
        max_speed: float | None = None,
        max_rotation: float | None = None,
        *,
        until: Callable[[], bool] | None = None,
        deceleration: float | None = None,
        on_tick: OnTick | None = None,
    ) -> bool:
        """Move in a straight line to a pose (4, 4) and come to rest, slower where the joints need it.

        Args:
            T_world_tcp: where to.
            max_speed: bound [m/s]; the configured one by default.
            max_rotation: bound [rad/s]; the configured one by default.
            until: asked after every tick; when it holds, the arm brakes.
            deceleration: how hard it then brakes [m/s2]; along the ramp by default.
            on_tick: called after every tick.

        Returns:
            True if the pose was reached, False if `until` or a reflex cut the move short.
        """
        self.stop(on_tick)
        start, error = self.T_desired, pose_error(self.T_desired, T_world_tcp)
        shares = scaled_profile(
            self.ik, self.q, start, error, self.config,
            max_speed or self.config.max_speed, max_rotation or self.config.max_rotation,
        )  # fmt: skip
        done = 0.0
        for share in shares:
            if self.reflex is not None:
                return False
            self.ramp.reset(error * (share - done) / self.config.dt)
            done = share
            self._tick(integrate_pose(start, error, share), on_tick)
            if until is not None and self.reflex is None and until():
                self.stop(on_tick, deceleration=deceleration)
                return False
        self.ramp.reset()
        return self.reflex is None

    def follow(
        self, path: Callable[[float], FloatArray], duration: float, on_tick: OnTick | None = None
    ) -> Reflex | None:
        """Follow offsets (3,) [m] of the tool point as a function of time [s]; the path must begin and
        end at rest and at zero.
        """
        self.stop(on_tick)
        start = self.T_desired
        for k in range(1, round(duration / self.config.dt) + 1):
            if self.reflex is not None:
                break
            self._tick(transform(start[:3, :3], start[:3, 3] + path(k * self.config.dt)), on_tick)
        return self.reflex

    def statistics(self) -> MotionStatistics:
        """Figures of the arm's motion since `reset`."""
        return MotionStatistics(
            duration=self.simulation.time - self._start,
            path_length=self._path_length,
            min_singular_value=self._min_singular_value,
            near_singularity=self._near,
            max_acceleration=self._max_acceleration,
            max_joint_acceleration=self._max_ddq.copy(),
            max_joint_velocity=self._max_dq.copy(),
            jerk_rms=float(np.sqrt(self._jerk_sum / self._jerk_count)) if self._jerk_count else 0.0,
            max_tracking_error=self._max_tracking,
            ik_seconds=self._ik_seconds,
            physics_seconds=self._physics_seconds,
        )

    def _tick(self, T_desired: FloatArray, on_tick: OnTick | None) -> None:
        c, sim = self.config, self.simulation
        if self.reflex is not None:
            return
        twist = pose_error(self.T_desired, T_desired) / c.dt
        self.T_desired = T_desired
        clock = time.perf_counter()
        self.solution = self.ik.step(self.q, T_desired, c.dt)
        self.q = self.q + self.solution.dq * c.dt
        self._ik_seconds += time.perf_counter() - clock
        clock = time.perf_counter()
        sim.set_arm_target(self.q, self.solution.dq)
        sim.step(self.steps_per_tick)
        self._physics_seconds += time.perf_counter() - clock
        T, achieved = sim.T_world_tcp, sim.twist_tcp
        self._forces.append(sim.external_force)
        self._observe(twist, T, achieved)
        arm = MeasuredArm(
            time=sim.time, q=sim.q, dq=sim.dq, twist=achieved, T_world_tcp=T,
            contact_force=self.external_force,
        )  # fmt: skip
        self.monitor.check(arm, self.solution, T_desired, c.dt)
        if self.reflex is not None:
            # brakes on: hold where the arm is
            self.q = np.array(sim.q, float)
            self.ramp.reset()
            sim.set_arm_target(self.q, np.zeros(7))
        if on_tick is not None:
            on_tick(self)

    def _observe(self, twist: FloatArray, T: FloatArray, achieved: FloatArray) -> None:
        assert self.solution is not None
        c, s = self.config, self.solution
        acceleration = float(np.linalg.norm(twist[:3] - self._twist[:3])) / c.dt
        self._max_acceleration = max(self._max_acceleration, acceleration)
        self._twist = twist
        self._max_ddq = np.maximum(self._max_ddq, np.abs(s.dq - self._dq) / c.dt)
        self._max_dq = np.maximum(self._max_dq, np.abs(s.demanded_dq))
        self._dq = s.dq
        self._min_singular_value = min(self._min_singular_value, s.min_singular_value)
        self._near += c.dt * (s.min_singular_value < c.singularity_warning)
        self._path_length += float(np.linalg.norm(T[:3, 3] - self._position))
        self._position = np.array(T[:3, 3])
        self._max_tracking = max(self._max_tracking, float(np.linalg.norm(T[:3, 3] - self.T_desired[:3, 3])))
        self._velocities.append(np.array(achieved[:3]))
        if len(self._velocities) == 3:
            a, b, d = self._velocities
            self._jerk_sum += float(np.sum((a - 2 * b + d) ** 2)) / c.dt**4
            self._jerk_count += 1
