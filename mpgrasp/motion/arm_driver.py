"""The 100 Hz velocity loop: twists and straight-line moves of the arm under protective stops.

Every motion is a sequence of desired tool poses, one per tick of 10 ms. Differential IK follows the
desired pose on the commanded joint positions, not on the measured ones, so neither servo lag nor
contact makes it drift; a reflex watches the distance between both.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.linear_algebra import norm, svd
from mpgrasp.motion.ik import DifferentialIK
from mpgrasp.motion.ik_solution import IkSolution
from mpgrasp.motion.motion_statistics import MotionMeter, MotionStatistics
from mpgrasp.motion.reflex import MeasuredArm, Reflex, ReflexMonitor
from mpgrasp.motion.time_scaling import scaled_profile
from mpgrasp.motion.trajectory import MotionConfig, TwistRamp, integrate_pose, mean_of, pose_error
from mpgrasp.scene.simulation import Simulation

FORCE_WINDOW = 5
"""Ticks over which the external force is averaged before it can stop the arm. The arm weighs some 20 kg as
seen from the tool; touching a hard table at 0.05 m/s is 1 N s, 100 N over one tick, and breaks nothing."""


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
        self._forces: deque[FloatArray] = deque([np.zeros(3)] * FORCE_WINDOW, maxlen=FORCE_WINDOW)
        self._meter = MotionMeter(
            self.config,
            self.simulation.time,
            self.simulation.T_world_tcp[:3, 3],
            float(svd(self.ik.jacobian(self.q)).sigma[-1]),
        )

    @property
    def reflex(self) -> Reflex | None:
        """The stop that ended the motion, if any."""
        return self.monitor.reflex

    @property
    def twist_commanded(self) -> FloatArray:
        """(6,) twist that the last tick asked for, world axes [m/s, rad/s]."""
        return self._meter.twist

    @property
    def twist_achieved(self) -> FloatArray:
        """(6,) measured twist, world axes [m/s, rad/s]."""
        return self.simulation.twist_tcp

    @property
    def touch(self) -> float:
        """External force on the robot over the last tick [N]: exact and instant, for feeling the way."""
        return norm(self._forces[-1])

    @property
    def external_force(self) -> float:
        """External force on the robot, mean over `FORCE_WINDOW` ticks [N]: what a stop is judged by."""
        return norm(mean_of(self._forces))

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
            linear = norm(twist[:3])
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
        return self._meter.statistics(self.simulation.time)

    def _tick(self, T_desired: FloatArray, on_tick: OnTick | None) -> None:
        c, sim = self.config, self.simulation
        if self.reflex is not None:
            return
        twist = pose_error(self.T_desired, T_desired) / c.dt
        self.T_desired = T_desired
        clock = time.perf_counter()
        self.solution = self.ik.step(self.q, T_desired, c.dt)
        self.q = self.q + self.solution.dq * c.dt
        self._meter.ik_seconds += time.perf_counter() - clock
        clock = time.perf_counter()
        sim.set_arm_target(self.q, self.solution.dq)
        sim.step(self.steps_per_tick)
        self._meter.physics_seconds += time.perf_counter() - clock
        T, achieved = sim.T_world_tcp, sim.twist_tcp
        self._forces.append(sim.external_force)
        self._meter.observe(twist, self.solution, T[:3, 3], T_desired[:3, 3], achieved[:3])
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
