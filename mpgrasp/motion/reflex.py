"""Protective stops: the limit of the FER that was broken, by which joint, by how much.

A real Franka has no "singularity" stop. Near a singularity a Cartesian velocity asks for joint
velocities or accelerations that the arm does not have, and that is what stops it. So the monitor
looks at what was measured and also at what was demanded before any limit was applied: a QP solver
would otherwise damp a violation away and the arm would just stop short in silence.

References:
    Franka Control Interface documentation, "Robot and interface specifications", FER.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, rotation_vector
from mpgrasp.linear_algebra import norm, product
from mpgrasp.motion.ik_solution import IkSolution
from mpgrasp.robot import limits

UNITS = {
    "joint_position": "rad",
    "joint_velocity": "rad/s",
    "joint_acceleration": "rad/s2",
    "cartesian_velocity": "m/s",
    "cartesian_rotation": "rad/s",
    "tracking_position": "m",
    "tracking_orientation": "rad",
    "collision_avoidance": "m",
    "contact_force": "N",
    "ik_infeasible": "",
}
"""Every limit that can stop the arm, with the unit of its value and bound."""


@dataclass(frozen=True, kw_only=True)
class Reflex:
    """A protective stop, named after the limit that was broken."""

    limit: str
    """One of `UNITS`."""
    joint: int | None
    """1..7, or None where the limit is not a joint's."""
    value: float
    """Value that was measured or demanded, in the limit's unit."""
    bound: float
    """Largest value that is allowed, in the limit's unit."""
    time: float
    """Simulated time [s]."""
    demanded: bool = False
    """True where the motion asked for `value` and it was not yet measured."""

    def __str__(self) -> str:
        unit = UNITS[self.limit]
        where = "" if self.joint is None else f"joint {self.joint} "
        verb = "asked for" if self.demanded else "at"
        text = f"{where}{verb} {self.value:.4g} {unit}, bound {self.bound:.4g} {unit}, t = {self.time:.2f} s"
        return f"{self.limit}: {text}"


def _fer(name: str) -> FloatArray:
    return np.array(getattr(limits, name), float)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReflexConfig:
    """Bounds of the protective stops; the joint bounds are the FER's."""

    q_min: FloatArray = field(default_factory=lambda: _fer("Q_MIN"))
    """(7,) [rad]"""
    q_max: FloatArray = field(default_factory=lambda: _fer("Q_MAX"))
    """(7,) [rad]"""
    dq_max: FloatArray = field(default_factory=lambda: _fer("DQ_MAX"))
    """(7,) [rad/s]"""
    ddq_max: FloatArray = field(default_factory=lambda: _fer("DDQ_MAX"))
    """(7,) rate of the commanded velocity [rad/s2]"""
    cartesian_velocity: float = limits.CARTESIAN_SPEED_MAX
    """Speed of the tool point [m/s]."""
    cartesian_rotation: float = 2.5
    """Rotation of the tool [rad/s]."""
    tracking_position: float = 0.02
    """Desired to measured tool point [m]. Ordinary motion stays below 2 mm; pressing on the table at
    the contact bound bends the servo by about as much as this."""
    tracking_orientation: float = 0.10
    """Desired to measured orientation [rad]."""
    ik_residual: float = 0.002
    """Distance that IK may fall behind the desired pose before the limit that holds it back is named [m];
    ordinary motion leaves micrometres."""
    ik_residual_angle: float = 0.02
    """The same for orientation [rad]."""
    contact_force: float = 100.0
    """External force on the robot, averaged over 50 ms [N]. Landing on a hard table at 0.05 m/s makes 60 to
    120 N (the arm weighs some 20 kg at the tool), at 0.035 m/s about 50, a held object makes its weight,
    and pressing on makes 12 N per millimetre."""

    def __post_init__(self) -> None:
        for name in ("q_min", "q_max", "dq_max", "ddq_max"):
            if np.shape(getattr(self, name)) != (7,):
                raise ConfigError(
                    f"{name} has the wrong shape", got=np.shape(getattr(self, name)), allowed="(7,)"
                )
        if not np.all(self.q_min < self.q_max):
            raise ConfigError("q_min must lie below q_max", got=self.q_min.tolist())
        for name in (
            "cartesian_velocity", "cartesian_rotation", "tracking_position", "tracking_orientation",
            "ik_residual", "ik_residual_angle", "contact_force",
        ):  # fmt: skip
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be positive", got=getattr(self, name))


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredArm:
    """State of the arm as measured at the end of a tick."""

    time: float
    """Simulated time [s]."""
    q: FloatArray
    """(7,) joint positions [rad]"""
    dq: FloatArray
    """(7,) joint velocities [rad/s]"""
    twist: FloatArray
    """(6,) velocity of the tool point, world axes [m/s, rad/s]"""
    T_world_tcp: FloatArray
    """(4, 4) pose of the tool point."""
    contact_force: float
    """External force on the robot [N]."""


class ReflexMonitor:
    """Watches every tick of the velocity loop; the first violation latches until `reset`."""

    def __init__(self, config: ReflexConfig | None = None) -> None:
        self.config = config or ReflexConfig()
        self.reflex: Reflex | None = None
        self._dq_commanded: FloatArray | None = None

    def reset(self) -> None:
        """Forget the last violation and the last commanded velocity."""
        self.reflex = None
        self._dq_commanded = None

    def check(
        self, arm: MeasuredArm, solution: IkSolution, T_world_tcp_desired: FloatArray, dt: float
    ) -> Reflex | None:
        """Judge one tick.

        Args:
            arm: what was measured at the end of the tick.
            solution: what IK made of the tick.
            T_world_tcp_desired: pose (4, 4) that the motion wanted at the end of the tick.
            dt: length of the tick [s].

        Returns:
            The first violation since `reset`, or None.
        """
        previous, self._dq_commanded = self._dq_commanded, np.array(solution.dq)
        if self.reflex is None:
            # the arm rests before its first command
            ddq = (self._dq_commanded - (0.0 if previous is None else previous)) / dt
            self.reflex = (
                self._joints(arm, solution, ddq)
                or self._demands(arm.time, solution)
                or self._cartesian(arm, T_world_tcp_desired)
            )
            if self.reflex is None and arm.contact_force > self.config.contact_force:
                self.reflex = _reflex("contact_force", arm.time, arm.contact_force, self.config.contact_force)
        return self.reflex

    def _joints(self, arm: MeasuredArm, solution: IkSolution, ddq: FloatArray) -> Reflex | None:
        c, q = self.config, arm.q
        within = (q >= c.q_min) & (q <= c.q_max)  # False for NaN too
        if not within.all():
            j = int(np.argmin(within))
            bound = c.q_min[j] if q[j] < c.q_min[j] else c.q_max[j]
            return _reflex("joint_position", arm.time, q[j], bound, joint=j + 1)
        over = _worst("joint_velocity", arm.time, arm.dq, c.dq_max)
        if over is not None:
            return over
        over = _worst("joint_acceleration", arm.time, ddq, c.ddq_max)
        if over is not None and solution.blocked_joint is not None:
            # a joint came to its limit, and the others jump to make up for it: they are not the cause
            return _blocked(arm.time, solution)
        return over

    def _demands(self, time: float, solution: IkSolution) -> Reflex | None:
        c = self.config
        over = _worst("joint_velocity", time, solution.demanded_dq, c.dq_max, demanded=True)
        if over is not None:
            return over
        if not solution.feasible:
            return _reflex("ik_infeasible", time, 1.0, 0.0)
        behind = solution.residual > c.ik_residual
        if not behind and solution.residual_angle <= c.ik_residual_angle:
            return None
        # IK fell behind: name what held it back
        if solution.blocked is not None:
            return _blocked(time, solution)
        if behind:
            return _reflex("tracking_position", time, solution.residual, c.ik_residual, demanded=True)
        return _reflex(
            "tracking_orientation", time, solution.residual_angle, c.ik_residual_angle, demanded=True
        )

    def _cartesian(self, arm: MeasuredArm, T_desired: FloatArray) -> Reflex | None:
        c, T = self.config, arm.T_world_tcp
        for limit, value, bound in (
            ("cartesian_velocity", norm(arm.twist[:3]), c.cartesian_velocity),
            ("cartesian_rotation", norm(arm.twist[3:]), c.cartesian_rotation),
            ("tracking_position", norm(T_desired[:3, 3] - T[:3, 3]), c.tracking_position),
            (
                "tracking_orientation",
                norm(rotation_vector(product(T[:3, :3].T, T_desired[:3, :3]))),
                c.tracking_orientation,
            ),
        ):
            if value > bound:
                return _reflex(limit, arm.time, value, bound)
        return None


def _reflex(
    limit: str,
    time: float,
    value: ArrayLike,
    bound: ArrayLike,
    *,
    joint: int | None = None,
    demanded: bool = False,
) -> Reflex:
    return Reflex(
        limit=limit, joint=joint, value=float(np.asarray(value)), bound=float(np.asarray(bound)),
        time=float(time), demanded=demanded,
    )  # fmt: skip


def _blocked(time: float, solution: IkSolution) -> Reflex:
    """The stop by the limit that the answer of IK leans on."""
    assert solution.blocked is not None
    return _reflex(
        solution.blocked, time, solution.blocked_value, solution.blocked_bound,
        joint=solution.blocked_joint, demanded=solution.blocked == "joint_velocity",
    )  # fmt: skip


def _worst(
    limit: str, time: float, values: FloatArray, bounds: FloatArray, *, demanded: bool = False
) -> Reflex | None:
    """The joint that breaks its symmetric bound by the largest factor, if any does."""
    size = np.abs(values)
    if (size <= bounds).all():  # False for NaN too
        return None
    j = int(np.argmax(size / bounds))
    return _reflex(limit, time, values[j], np.copysign(bounds[j], values[j]), joint=j + 1, demanded=demanded)
