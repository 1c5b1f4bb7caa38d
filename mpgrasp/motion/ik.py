"""Differential inverse kinematics of the arm: a desired tool pose or twist in, joint velocity out.

A quadratic program (mink, daqp) follows the desired pose within joint position, joint velocity and
collision limits. Beside its answer stands `demanded_dq`, the joint velocity that the motion would
have needed without any limit, so that a protective stop can see what the program had to give up.

References:
    Yoshikawa, "Manipulability of Robotic Mechanisms", IJRR 4(2), 1985.
    Zakka, "mink: Python inverse kinematics based on MuJoCo".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mink
import mujoco
import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.motion.trajectory import integrate_pose, pose_error
from mpgrasp.robot import panda

TCP_SITE = "tcp"


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


@dataclass(frozen=True, kw_only=True, eq=False)
class IkSolution:
    """One tick of differential IK."""

    dq: FloatArray
    """(7,) joint velocity to command [rad/s]; zero where the program had no solution."""
    demanded_dq: FloatArray
    """(7,) least-norm joint velocity that the motion needs without any limit [rad/s]."""
    manipulability: float
    """sqrt(det(J J^T)) of the (6, 7) tool Jacobian in m and rad: the product of its singular values."""
    min_singular_value: float
    """Smallest singular value of the same Jacobian."""
    feasible: bool = True
    """False where the quadratic program had no solution."""
    residual: float = 0.0
    """Distance that is left to the desired position after this tick [m]."""
    residual_angle: float = 0.0
    """Angle that is left to the desired orientation after this tick [rad]."""
    blocked: str | None = None
    """The limit that holds the motion back: joint_position, joint_velocity or collision_avoidance."""
    blocked_joint: int | None = None
    """1..7 where `blocked` is a joint's limit."""
    blocked_value: float = 0.0
    """Demanded velocity, commanded position or distance at that limit [rad/s, rad, m]."""
    blocked_bound: float = 0.0
    """Bound of that limit, same unit."""


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
        self._frame = mink.FrameTask(TCP_SITE, "site", position_cost=1.0, orientation_cost=1.0)
        self._posture = mink.PostureTask(self.model, cost=self.config.posture_cost)
        margin = self.config.joint_margin
        self._q_min, self._q_max = self.model.jnt_range[:, 0] + margin, self.model.jnt_range[:, 1] - margin
        self._dq_max = np.array(panda.DQ_MAX) * self.config.velocity_fraction
        self._collision_limits: dict[float, mink.CollisionAvoidanceLimit] = {}
        names = [self.model.joint(j).name for j in range(self.model.njnt)]
        self._limits: list[mink.Limit] = [
            mink.ConfigurationLimit(self.model, min_distance_from_limits=margin),
            mink.VelocityLimit(self.model, dict(zip(names, self._dq_max, strict=True))),
        ]
        self._pairs = panda.collision_pairs(self.model) if self.config.collisions else []
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
        U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
        error = pose_error(T, T_world_tcp)
        demanded = Vt.T @ ((U.T @ error) / np.maximum(sigma, 1e-9)) / dt
        # the elbow swings home within the null space alone, so it never pulls at the tool
        towards_home = panda.Q_HOME - q
        towards_home = towards_home - Vt.T @ (Vt @ towards_home)
        if posture_rate is None:
            wish = self.config.posture_rate * towards_home
            self._swing += (wish - self._swing) * (dt / self.config.posture_smoothing)
            swing = self._swing
        else:
            swing = posture_rate * towards_home
        self._posture.set_target(q + swing * dt)
        self._frame.set_target(mink.SE3.from_matrix(T_world_tcp))
        limits = [*self._limits, *self._collision_limit(dt)]
        try:
            dq = mink.solve_ik(
                self.configuration, [self._frame, self._posture], dt, "daqp",
                damping=self.config.damping, limits=limits,
            )  # fmt: skip
            feasible = bool(np.all(np.isfinite(dq)))
        except mink.NoSolutionFound:
            feasible = False
        if not feasible:
            dq = np.zeros(7)
        left = error - J @ dq * dt
        residual, residual_angle = float(np.linalg.norm(left[:3])), float(np.linalg.norm(left[3:]))
        blocked: tuple[str | None, int | None, float, float] = (None, None, 0.0, 0.0)
        if residual > 1e-4 or residual_angle > 1e-3:
            blocked = self._blocked(q, dq, demanded, dt)
        return IkSolution(
            dq=dq,
            demanded_dq=demanded,
            manipulability=float(np.prod(sigma)),
            min_singular_value=float(sigma[-1]),
            feasible=feasible,
            residual=residual,
            residual_angle=residual_angle,
            blocked=blocked[0],
            blocked_joint=blocked[1],
            blocked_value=blocked[2],
            blocked_bound=blocked[3],
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
            lengths = float(np.linalg.norm(error[:3])) / 0.1, float(np.linalg.norm(error[3:])) / 0.5
            target = integrate_pose(T, error, 1.0 / max(1.0, *lengths))
            dq = self.step(q, target, dt, posture_rate=0.2 / dt).dq
            # what is left of the motion once the tool has arrived is the elbow's
            if np.linalg.norm(error) < tolerance and np.linalg.norm(dq) * dt < 1e-3:
                return q
            q = q + dq * dt
        raise ConfigError(
            "tool pose is out of reach",
            got=np.round(T_world_tcp[:3, 3], 4).tolist(),
            allowed="tool down, up to 0.75 m from the base at 0.4 m height and 0.79 m near the table",
        )

    def _jacobian(self) -> FloatArray:
        J = np.empty((6, 7))
        mujoco.mj_jacSite(self.model, self.configuration.data, J[:3], J[3:], self._site)
        return J

    def _collision_limit(self, dt: float) -> list[mink.Limit]:
        if not self._pairs:
            return []
        if dt not in self._collision_limits:
            c = self.config
            # mink bounds the step, not the velocity, by gain * distance / dt: with the gain it calls
            # ordinary the limit is a wall that is met at full speed, so scale the gain by dt twice
            self._collision_limits[dt] = mink.CollisionAvoidanceLimit(
                self.model, self._pairs, gain=c.collision_rate * dt * dt,
                minimum_distance_from_collisions=c.collision_distance,
                collision_detection_distance=c.collision_range,
            )  # fmt: skip
        return [self._collision_limits[dt]]

    def _blocked(
        self, q: FloatArray, dq: FloatArray, demanded: FloatArray, dt: float
    ) -> tuple[str | None, int | None, float, float]:
        """The limit that the answer leans on: its name, joint, value and bound."""
        after = q + dq * dt
        slack = np.minimum(after - self._q_min, self._q_max - after)
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
        distance = self.clearance()
        if distance < 2 * self.config.collision_distance:
            return "collision_avoidance", None, distance, self.config.collision_distance
        return None, None, 0.0, 0.0

    def clearance(self) -> float:
        """Least distance [m] within the pairs that must not collide, at the last pose; inf beyond
        `collision_range`.
        """
        if not self._pairs:
            return np.inf
        limit = next(iter(self._collision_limits.values()), None)
        if limit is None:
            return np.inf
        reach = self.config.collision_range
        least = min(
            mujoco.mj_geomDistance(self.model, self.configuration.data, a, b, reach, None)
            for a, b in limit.geom_id_pairs
        )
        return float(least) if least < reach else np.inf


def solve_pose(q0: FloatArray, T_world_tcp: FloatArray, ik: DifferentialIK | None = None) -> FloatArray:
    """Joint positions (7,) [rad] that put the tool at a pose; see `DifferentialIK.solve`."""
    return (ik or DifferentialIK()).solve(q0, T_world_tcp)
