"""Differential inverse kinematics of the arm: a desired tool pose or twist in, joint velocity out.

A quadratic program (mink, daqp) follows the desired pose within joint position, joint velocity and
collision limits; its answer without any limit is taken where that meets them all. Beside its answer stands
`demanded_dq`, the joint velocity that the motion would have needed without any limit, so that a protective
stop can see what the program had to give up.

References:
    Yoshikawa, "Manipulability of Robotic Mechanisms", IJRR 4(2), 1985.
    Zakka, "mink: Python inverse kinematics based on MuJoCo".
"""

from __future__ import annotations

from functools import cache

import mink
import mujoco
import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.linear_algebra import Svd, least_norm, norm, product, svd
from mpgrasp.motion.ik_config import IkConfig
from mpgrasp.motion.ik_program import Clearance, ClearanceLimit, ToolTask, free_step
from mpgrasp.motion.ik_solution import IkSolution
from mpgrasp.motion.trajectory import integrate_pose, pose_error
from mpgrasp.robot import panda

TCP_SITE = "tcp"
_CLOSED = 0.95
"""Share of the way to a joint limit that the program closes in a tick at most; mink's default."""

_Blocked = tuple[str, int | None, float, float]
"""A limit that holds the motion back: its name, joint, value and bound."""


@cache
def _arm_model() -> mujoco.MjModel:
    # compiled once: nobody writes to it
    return panda.arm_model()


class DifferentialIK:
    """Follows a desired tool pose with the arm-only model of the Panda."""

    def __init__(self, config: IkConfig | None = None, model: mujoco.MjModel | None = None) -> None:
        self.config = config or IkConfig()
        self.model = _arm_model() if model is None else model
        self.configuration = mink.Configuration(self.model, q=np.array(panda.Q_HOME))
        self._site = self.model.site(TCP_SITE).id
        margin = self.config.joint_margin
        self._q_min, self._q_max = self.model.jnt_range[:, 0] + margin, self.model.jnt_range[:, 1] - margin
        self._dq_max = np.array(panda.DQ_MAX) * self.config.velocity_fraction
        self._collision_limits: dict[float, ClearanceLimit] = {}
        names = [self.model.joint(j).name for j in range(self.model.njnt)]
        self._limits: list[mink.Limit] = [
            mink.ConfigurationLimit(self.model, gain=_CLOSED, min_distance_from_limits=margin),
            mink.VelocityLimit(self.model, dict(zip(names, self._dq_max, strict=True))),
        ]
        self._pairs = panda.collision_pairs(self.model) if self.config.collisions else []
        self._geoms = self._geom_pairs()
        self._clearance = Clearance(self.model, self._geoms, self.config.collision_range)
        self._swing = np.zeros(7)

    def reset(self) -> None:
        """Forget the motion of the elbow; call it when the arm was moved by other means."""
        self._swing = np.zeros(7)

    def pose(self, q: FloatArray) -> FloatArray:
        """Tool pose `T_world_tcp` (4, 4) at q (7,) [rad]."""
        self.configuration.update(q)
        data = self.configuration.data
        return transform(data.site_xmat[self._site].reshape(3, 3), data.site_xpos[self._site])

    def jacobian(self, q: FloatArray) -> FloatArray:
        """Tool Jacobian (6, 7) at q (7,) [rad], world axes, linear [m] then angular [rad]."""
        self.configuration.update(q)
        return self._jacobian()

    def step(
        self, q: FloatArray, T_world_tcp: FloatArray, dt: float, *, posture_rate: float | None = None
    ) -> IkSolution:
        """Joint velocity that brings the tool from q to a desired pose within one tick.

        Args:
            q: commanded joint positions (7,) [rad].
            T_world_tcp: pose (4, 4) wanted at the end of the tick.
            dt: length of the tick [s].
            posture_rate: swing the elbow home at once with this rate [1/s], instead of gently along the
                configured one; for solving, not for driving.
        """
        T = self.pose(q)
        J = self._jacobian()
        factors = svd(J)
        error = pose_error(T, T_world_tcp)
        demanded = least_norm(factors, error, 1e-9) / dt
        # the elbow swings home within the null space alone, so it never pulls at the tool
        towards_home = panda.Q_HOME - q
        towards_home = towards_home - product(factors.Vt.T, product(factors.Vt, towards_home))
        if posture_rate is None:
            wish = self.config.posture_rate * towards_home
            self._swing += (wish - self._swing) * (dt / self.config.posture_smoothing)
            swing = self._swing
        else:
            swing = posture_rate * towards_home
        dq, feasible = self._answer(q, J, factors, error, swing * dt, dt)
        left = error - product(J, dq) * dt
        residual, residual_angle = norm(left[:3]), norm(left[3:])
        blocked = self._joint_limit(q, dq, demanded, dt)
        if blocked is None and (residual > 1e-4 or residual_angle > 1e-3):
            blocked = self._collision()
        limit, joint, value, bound = blocked or (None, None, 0.0, 0.0)
        return IkSolution(
            dq=dq,
            demanded_dq=demanded,
            manipulability=float(np.prod(factors.sigma)),
            min_singular_value=float(factors.sigma[-1]),
            feasible=feasible,
            residual=residual,
            residual_angle=residual_angle,
            blocked=limit,
            blocked_joint=joint,
            blocked_value=value,
            blocked_bound=bound,
        )

    def solve(
        self, q0: FloatArray, T_world_tcp: FloatArray, *, tolerance: float = 1e-5, iterations: int = 400
    ) -> FloatArray:
        """Joint positions (7,) [rad] that put the tool at a pose with the elbow close to home.

        Iterates `step` and leaves a motion that is under way undisturbed.

        Args:
            q0: where to start (7,) [rad].
            T_world_tcp: wanted pose (4, 4).
            tolerance: of the pose, in m and rad.
            iterations: how many steps to try.

        Raises:
            ConfigError: if the pose is out of reach within joint and collision limits.
        """
        q, dt = np.array(q0, float), 0.05
        for _ in range(iterations):
            T = self.pose(q)
            error = pose_error(T, T_world_tcp)
            # 10 cm and half a radian at a time keep the linearisation honest
            lengths = norm(error[:3]) / 0.1, norm(error[3:]) / 0.5
            target = integrate_pose(T, error, 1.0 / max(1.0, *lengths))
            dq = self.step(q, target, dt, posture_rate=0.2 / dt).dq
            # what is left of the motion once the tool has arrived is the elbow's
            if norm(error) < tolerance and norm(dq) * dt < 1e-3:
                return q
            q = q + dq * dt
        raise ConfigError(
            "tool pose is out of reach",
            got=np.round(T_world_tcp[:3, 3], 4).tolist(),
            allowed="tool down, up to 0.75 m from the base at 0.4 m height and 0.79 m near the table",
        )

    def _answer(
        self, q: FloatArray, J: FloatArray, factors: Svd, error: FloatArray, swing: FloatArray, dt: float
    ) -> tuple[FloatArray, bool]:
        """Joint velocity (7,) of the program at the last pose, and whether it has one; zero if not."""
        c = self.config
        if c.posture_cost + c.damping > 0:
            step = free_step(factors, error, swing, c.posture_cost, c.damping)
            if self._is_free(q, step, dt):
                return step / dt, True
        task = ToolTask(J, error, swing, c.posture_cost)
        limits = [*self._limits, *self._collision_limit(dt)]
        try:
            dq = mink.solve_ik(self.configuration, [task], dt, "daqp", damping=c.damping, limits=limits)
        except mink.NoSolutionFound:
            return np.zeros(7), False
        return (dq, True) if np.all(np.isfinite(dq)) else (np.zeros(7), False)

    def _is_free(self, q: FloatArray, step: FloatArray, dt: float) -> bool:
        """True if a step (7,) [rad] meets every limit of the program, at the last pose."""
        room_up, room_down = _CLOSED * (self._q_max - q), _CLOSED * (q - self._q_min)
        within = (step <= room_up) & (-step <= room_down) & (np.abs(step) <= self._dq_max * dt)
        return bool(within.all()) and self._clearance.is_ample(self.configuration.data)

    def _jacobian(self) -> FloatArray:
        J = np.empty((6, 7))
        mujoco.mj_jacSite(self.model, self.configuration.data, J[:3], J[3:], self._site)
        return J

    def _geom_pairs(self) -> list[tuple[int, int]]:
        """Pairs of geoms that must not collide."""
        return [
            (self.model.geom(a).id, self.model.geom(b).id)
            for some, others in self._pairs
            for a in some
            for b in others
        ]

    def _collision_limit(self, dt: float) -> list[mink.Limit]:
        if not self._pairs:
            return []
        if dt not in self._collision_limits:
            c = self.config
            # mink bounds the step, not the velocity, by gain * distance / dt: with the gain it calls
            # ordinary the limit is a wall that is met at full speed, so scale the gain by dt twice
            self._collision_limits[dt] = ClearanceLimit(
                self.model, self._pairs, gain=c.collision_rate * dt * dt,
                minimum_distance_from_collisions=c.collision_distance,
                collision_detection_distance=c.collision_range,
            )  # fmt: skip
        return [self._collision_limits[dt]]

    def room(self, q: FloatArray) -> FloatArray:
        """Return how far joints (..., 7) are from the nearer end of the range that the program uses [rad].

        Below 0 they are within `joint_margin` of a limit.
        """
        return np.asarray(np.minimum(q - self._q_min, self._q_max - q))

    def _joint_limit(self, q: FloatArray, dq: FloatArray, demanded: FloatArray, dt: float) -> _Blocked | None:
        """The joint limit that the answer leans on."""
        after = q + dq * dt
        slack = self.room(after)
        # the program closes 95 % of the gap to a joint limit per tick
        j = int(np.argmin(slack))
        if slack[j] < 2e-3:
            bound = (
                self._q_min[j] if after[j] - self._q_min[j] < self._q_max[j] - after[j] else self._q_max[j]
            )
            return "joint_position", j + 1, float(after[j]), float(bound)
        j = int(np.argmax(np.abs(dq) / self._dq_max))
        if abs(dq[j]) > 0.999 * self._dq_max[j]:
            return "joint_velocity", j + 1, float(demanded[j]), float(np.copysign(self._dq_max[j], dq[j]))
        return None

    def _collision(self) -> _Blocked | None:
        """The collision limit, where the last pose is close to it."""
        distance = self.clearance()
        if distance < 2 * self.config.collision_distance:
            return "collision_avoidance", None, distance, self.config.collision_distance
        return None

    def clearance(self) -> float:
        """Least distance [m] within the pairs that must not collide, at the last pose; inf beyond
        `collision_range`.
        """
        if not self._geoms:
            return np.inf
        reach = self.config.collision_range
        least = min(
            mujoco.mj_geomDistance(self.model, self.configuration.data, a, b, reach, None)
            for a, b in self._geoms
        )
        return float(least) if least < reach else np.inf


def solve_pose(q0: FloatArray, T_world_tcp: FloatArray, ik: DifferentialIK | None = None) -> FloatArray:
    """Joint positions (7,) [rad] that put the tool at a pose; see `DifferentialIK.solve`."""
    return (ik or DifferentialIK()).solve(q0, T_world_tcp)
