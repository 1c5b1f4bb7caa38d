"""Time scaling of straight-line moves: as slow as every joint needs it to keep its limits.

The motion planner of a real arm times a path by its joints, not only by its tool: near a singularity a
slow tool means fast joints. A move is therefore rehearsed on the arm's kinematics before it is made. What
follows a twist is not slowed down: there the same limits are what stops the arm.

References:
    Hollerbach, "Dynamic Scaling of Manipulator Trajectories", ASME J. Dyn. Sys. 106(1), 1984: a path
    that takes k times as long needs velocities of 1/k and accelerations of 1/k^2.
"""

from __future__ import annotations

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import least_squares, norm
from mpgrasp.motion.ik import DifferentialIK
from mpgrasp.motion.trajectory import MotionConfig, integrate_pose, path_profile, pose_error
from mpgrasp.robot import panda

STRIDE = 4
"""Ticks between two looks at the joints; a profile's acceleration changes over `MotionConfig.smoothing`."""


def scaled_profile(
    ik: DifferentialIK,
    q: FloatArray,
    T_start: FloatArray,
    error: FloatArray,
    config: MotionConfig,
    speed: float,
    rotation: float,
) -> FloatArray:
    """Shares of a straight-line move after each tick, (n,), as slow as its joints need it.

    Args:
        ik: kinematics of the arm.
        q: commanded joint positions (7,) [rad] at the start.
        T_start: desired pose (4, 4) at the start.
        error: (6,) what carries it to the end of the move, world axes [m, rad].
        config: how briskly the arm moves, and what its joints may use.
        speed: bound [m/s].
        rotation: bound [rad/s].
    """
    length, angle = norm(error[:3]), norm(error[3:])
    shares = path_profile(length, angle, config, speed, rotation)
    factor = slowdown(ik, q, T_start, error, shares, config)
    return shares if factor == 1 else path_profile(length, angle, config, speed, rotation, factor)


def slowdown(
    ik: DifferentialIK,
    q: FloatArray,
    T_start: FloatArray,
    error: FloatArray,
    shares: FloatArray,
    config: MotionConfig,
) -> float:
    """Factor, 1 or more, by which a move with these shares (n,) must take longer to leave the joints their
    margin; the other arguments are those of `scaled_profile`.

    Returns:
        The factor, `MotionConfig.max_slowdown` at most: a path through a singularity itself would have
        to stand still there, and is left to the protective stop.
    """
    if len(shares) == 0:
        return 1.0
    ends = np.unique(np.append(np.arange(STRIDE - 1, len(shares), STRIDE), len(shares) - 1))
    path = np.vstack([q, rehearse(ik, q, T_start, error, shares[ends])])
    dt = np.diff(ends, prepend=-1) * config.dt
    dq = np.diff(path, axis=0) / dt[:, None]
    # from rest to rest
    ddq = np.diff(dq, axis=0, prepend=np.zeros((1, 7)), append=np.zeros((1, 7)))
    ddq /= (0.5 * (np.append(dt, dt[-1]) + np.append(dt[0], dt)))[:, None]
    velocity = float(np.max(np.abs(dq) / panda.DQ_MAX)) / config.joint_fraction
    acceleration = float(np.max(np.abs(ddq) / panda.DDQ_MAX)) / config.joint_fraction
    return float(np.clip(max(velocity, np.sqrt(acceleration)), 1.0, config.max_slowdown))


def rehearse(
    ik: DifferentialIK, q: FloatArray, T_start: FloatArray, error: FloatArray, shares: FloatArray
) -> FloatArray:
    """Joint positions (n, 7) [rad] of least motion along a straight line, after each of its shares (n,)."""
    q, path = np.array(q, float), np.empty((len(shares), 7))
    for k, share in enumerate(shares):
        step = pose_error(ik.pose(q), integrate_pose(T_start, error, float(share)))
        q = q + least_squares(ik.jacobian(q), step, 1e-6)
        path[k] = q
    return path
