"""Answer of the differential inverse kinematics for one tick, and what held the motion back."""

from __future__ import annotations

from dataclasses import dataclass

from mpgrasp.geometry import FloatArray


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
    """Limit that the answer leans on: joint_position or joint_velocity, whether or not the other joints make
    up for it; or collision_avoidance, where the motion is held back."""
    blocked_joint: int | None = None
    """1..7 where `blocked` is a joint's limit."""
    blocked_value: float = 0.0
    """Demanded velocity, commanded position or distance at that limit [rad/s, rad, m]."""
    blocked_bound: float = 0.0
    """Bound of that limit, same unit."""
