"""Rigid transforms, look-at poses and angles modulo pi, in plain numpy.

A transform `T_a_b` is (4, 4) and maps points of frame b to frame a: `p_a = T_a_b p_b`.
Quaternions are wxyz. Angles are radians.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.linear_algebra import dot, norm, product

FloatArray = NDArray[np.floating]

_IDENTITY = np.eye(4)
MAX_SKEW = 1e-3
"""Most that a rotation misses length 1 or a right angle by; stored calibrations have few digits."""
MAX_DISTANCE = 100.0
"""Farther from the world's origin no camera is that looks at a table [m]."""


def check_pose(T: object, name: str) -> None:
    """Raise ConfigError unless T is a rigid transform (4, 4): finite, orthonormal, right-handed, near."""
    if not isinstance(T, np.ndarray) or T.shape != (4, 4) or not np.issubdtype(T.dtype, np.floating):
        got = f"{T.dtype} {T.shape}" if isinstance(T, np.ndarray) else type(T).__name__
        raise ConfigError(f"{name} is no pose", got=got, allowed="an array (4, 4) of floats")
    # in plain numbers: that is faster for so few, and the same on every processor
    (a, b, c, x), (d, e, f, y), (g, h, i, z), last = T.tolist()
    products = (a * b + d * e + g * h, a * c + d * f + g * i, b * c + e * f + h * i)
    lengths = (a * a + d * d + g * g - 1, b * b + e * e + h * h - 1, c * c + f * f + i * i - 1)
    wrong = None
    if not all(math.isfinite(number) for number in (*products, *lengths, x, y, z)):
        wrong = "is not finite"
    elif max(map(abs, (*products, *lengths))) > MAX_SKEW or last != [0, 0, 0, 1]:
        wrong = "is no rigid transform"
    elif a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0:
        wrong = "is left-handed: one of its axes points the wrong way"
    elif max(abs(x), abs(y), abs(z)) > MAX_DISTANCE:
        wrong = "lies so far away that it looks like millimetres"
    if wrong is not None:
        raise ConfigError(
            f"{name} {wrong}",
            got=T.tolist(),
            allowed="an orthonormal, right-handed rotation, a position [m], and 0 0 0 1",
        )


def transform(rotation: ArrayLike, position: ArrayLike) -> FloatArray:
    """Transform (4, 4) from a rotation (3, 3) and a position (3,) [m]."""
    T = _IDENTITY.copy()
    T[:3, :3] = rotation
    T[:3, 3] = position
    return T


def invert(T: FloatArray) -> FloatArray:
    """Inverse (4, 4) of a rigid transform, exact because the rotation is orthonormal."""
    R = T[:3, :3]
    return transform(R.T, -product(R.T, T[:3, 3]))


def transform_points(T: FloatArray, points: FloatArray) -> FloatArray:
    """Map points (..., 3) [m] by T (4, 4)."""
    return np.asarray(np.einsum("...j,kj->...k", points, T[:3, :3]) + T[:3, 3])


def rotation_x(angle: float) -> FloatArray:
    """Rotation (3, 3) about x."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_z(angle: float) -> FloatArray:
    """Rotation (3, 3) about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_about(axis: ArrayLike, angle: float) -> FloatArray:
    """Rotation (3, 3) by an angle [rad] about an axis (3,) of any length."""
    x, y, z = np.asarray(axis, float) / norm(axis)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * product(K, K))


def rotation_from_quaternion(quaternion: ArrayLike) -> FloatArray:
    """Rotation (3, 3) of a quaternion (4,), wxyz, of unit length."""
    w, x, y, z = (float(number) for number in np.asarray(quaternion, float))
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    # summed in the order of MuJoCo's mju_quat2Mat, so that poses agree with it to the last bit
    return np.array(
        [
            [(ww - yy) + (xx - zz), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), (ww + yy) - (xx + zz), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), (ww - yy) + (zz - xx)],
        ]
    )


def looking_down(position: ArrayLike, yaw: float = 0.0) -> FloatArray:
    """Pose (4, 4) whose z axis points straight down and whose x axis has heading `yaw` in the world.

    It serves both the tool (approach along +z) and an OpenCV camera (optical axis +z). At yaw 0 the
    axes are x = world x, y = -world y, z = -world z.
    """
    return transform(rotation_z(yaw) * np.array([1.0, -1.0, -1.0]), position)


def look_at(eye: ArrayLike, target: ArrayLike, x_axis: ArrayLike = (1.0, 0.0, 0.0)) -> FloatArray:
    """Pose (4, 4) of an OpenCV camera (x right, y down, z forward) at `eye` that looks at `target`.

    `x_axis` is the world direction that the image's right side should follow as far as possible; it
    must not be parallel to the line of sight.
    """
    eye = np.asarray(eye, float)
    z = np.asarray(target, float) - eye
    z /= norm(z)
    x = np.asarray(x_axis, float)
    x = x - dot(x, z) * z
    x /= norm(x)
    return transform(np.column_stack([x, np.cross(z, x), z]), eye)


def wrap_half_pi(angle: ArrayLike) -> FloatArray:
    """Fold angles of lines (a grasp is the same after half a turn) into [-pi/2, pi/2)."""
    folded = np.mod(np.asarray(angle, float) + np.pi / 2, np.pi) - np.pi / 2
    # np.mod may round up to pi itself for tiny negative inputs
    return np.where(folded >= np.pi / 2, -np.pi / 2, folded)


def wrap_pi(angle: ArrayLike) -> FloatArray:
    """Fold angles into [-pi, pi)."""
    folded = np.mod(np.asarray(angle, float) + np.pi, 2 * np.pi) - np.pi
    return np.where(folded >= np.pi, -np.pi, folded)


def line_angle_difference(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Smallest angle [0, pi/2] between lines of angle a and b."""
    return np.abs(wrap_half_pi(np.asarray(a, float) - np.asarray(b, float)))


def rotation_vector(R: FloatArray) -> FloatArray:
    """Axis times angle (3,) [rad] of a rotation (3, 3); the logarithm map of SO(3)."""
    # in plain numbers: numpy takes several times as long for so few of them
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    axis = np.array([zy - yz, xz - zx, yx - xy])
    sine, cosine = norm(axis) / 2, (xx + yy + zz - 1) / 2
    angle = math.atan2(sine, cosine)
    if angle < 1e-9:
        return axis / 2
    if sine < 1e-6:  # half a turn: the axis is the eigenvector of eigenvalue 1
        square = (R + R.T) / 4 + np.eye(3) / 2  # axis times itself, (3, 3)
        column = square[:, np.argmax(np.diagonal(square))]
        return np.asarray(column / norm(column) * angle)
    return np.asarray(axis / (2 * sine) * angle)
