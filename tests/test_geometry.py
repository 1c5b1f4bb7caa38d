"""Transforms, rotations and angles agree with their definitions and with other libraries."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import (
    check_pose,
    invert,
    line_angle_difference,
    look_at,
    looking_down,
    rotation_from_quaternion,
    rotation_vector,
    rotation_x,
    rotation_z,
    transform,
    transform_points,
    wrap_half_pi,
    wrap_pi,
)


def _random_pose(rng: np.random.Generator) -> np.ndarray:
    R = rotation_z(rng.uniform(-3, 3)) @ rotation_x(rng.uniform(-3, 3)) @ rotation_z(rng.uniform(-3, 3))
    return transform(R, rng.standard_normal(3))


def test_inverse_undoes_a_transform() -> None:
    rng = np.random.default_rng(0)
    T = _random_pose(rng)
    points = rng.standard_normal((4, 5, 3))
    np.testing.assert_allclose(transform_points(invert(T), transform_points(T, points)), points, atol=1e-12)
    np.testing.assert_allclose(invert(T), np.linalg.inv(T), atol=1e-12)


@pytest.mark.parametrize("yaw", [-2.5, 0.0, 0.4])
def test_looking_down_points_its_z_axis_at_the_floor(yaw: float) -> None:
    T = looking_down([1, 2, 3], yaw)
    np.testing.assert_allclose(T[:3, 2], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(T[:3, 0], [np.cos(yaw), np.sin(yaw), 0], atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_look_at_sees_its_target_on_the_optical_axis() -> None:
    T = look_at([0.3, -0.2, 0.6], [0.5, 0.1, 0.0], x_axis=(0, 1, 0))
    in_camera = transform_points(invert(T), np.array([0.5, 0.1, 0.0]))
    np.testing.assert_allclose(in_camera[:2], 0, atol=1e-12)
    assert in_camera[2] > 0
    assert T[1, 0] > 0.9
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_look_at_straight_down_is_looking_down() -> None:
    np.testing.assert_allclose(look_at([1, 2, 3], [1, 2, 0]), looking_down([1, 2, 3]), atol=1e-12)


def test_folding_keeps_the_line_or_the_direction_and_the_range() -> None:
    angles = np.concatenate(
        [np.linspace(-20, 20, 1001), [np.pi / 2, -np.pi / 2, np.pi, -1e-17, -np.pi / 2 - 1e-17]]
    )
    half, full = wrap_half_pi(angles), wrap_pi(angles)
    assert ((half >= -np.pi / 2) & (half < np.pi / 2)).all()
    assert ((full >= -np.pi) & (full < np.pi)).all()
    np.testing.assert_allclose(np.exp(2j * half), np.exp(2j * angles), atol=1e-12)
    np.testing.assert_allclose(np.exp(1j * full), np.exp(1j * angles), atol=1e-12)


def test_lines_half_a_turn_apart_do_not_differ() -> None:
    assert line_angle_difference(0.1, 0.1 + np.pi) == pytest.approx(0, abs=1e-12)
    assert line_angle_difference(1.5, -1.5) == pytest.approx(np.pi - 3)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-4, 1.0, 3.1, np.pi])
def test_rotation_vector_is_axis_times_angle(angle: float) -> None:
    turned = _random_pose(np.random.default_rng(3))[:3, :3]
    R = turned @ rotation_z(angle) @ turned.T
    vector = rotation_vector(R)
    assert np.linalg.norm(vector) == pytest.approx(angle, abs=1e-9)
    if angle > 1e-6:
        axis = vector / np.linalg.norm(vector)
        assert abs(axis @ turned[:, 2]) == pytest.approx(1, abs=1e-6)
        if angle < np.pi:
            assert axis @ turned[:, 2] > 0


def test_a_quaternion_turns_as_in_scipy_and_as_in_mujoco() -> None:
    expected = np.empty(9)
    for wxyz in np.random.default_rng(0).standard_normal((100, 4)):
        wxyz /= np.linalg.norm(wxyz)
        R = rotation_from_quaternion(wxyz)
        np.testing.assert_allclose(R, Rotation.from_quat(np.roll(wxyz, -1)).as_matrix(), atol=1e-14)
        mujoco.mju_quat2Mat(expected, wxyz)
        np.testing.assert_allclose(R.ravel(), expected, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(rotation_from_quaternion((1.0, 0.0, 0.0, 0.0)), np.eye(3))


def _changed(row: int, col: int, value: float) -> np.ndarray:
    T = looking_down([0.5, -0.1, 0.4], 0.7)
    T[row, col] = value
    return T


POSES = {
    "nan": (_changed(0, 3, np.nan), "not finite"),
    "infinite": (_changed(1, 1, np.inf), "not finite"),
    "sheared": (_changed(0, 1, 0.2), "no rigid transform"),
    "scaled": (np.diag([1.01, 1.01, 1.01, 1.0]), "no rigid transform"),
    "zeros": (np.zeros((4, 4)), "no rigid transform"),
    "transposed": (looking_down([0.5, -0.1, 0.4], 0.7).T, "no rigid transform"),
    "mirrored": (np.diag([1.0, 1.0, -1.0, 1.0]), "left-handed"),
    "millimetres": (looking_down([500.0, -100.0, 400.0]), "looks like millimetres"),
    "3x4": (np.eye(4)[:3], r"no pose; got 'float64 \(3, 4\)'"),
    "rotation": (np.eye(3), "no pose"),
    "integers": (np.eye(4, dtype=int), "no pose; got 'int64"),
    "list": (np.eye(4).tolist(), "no pose; got 'list'"),
}


@pytest.mark.parametrize(("T", "said"), POSES.values(), ids=POSES)
def test_what_is_no_rigid_pose_in_metres_is_refused_by_name(T: object, said: str) -> None:
    with pytest.raises(ConfigError, match=f"T_world_camera.*{said}"):
        check_pose(T, "T_world_camera")


def test_poses_of_few_digits_are_taken() -> None:
    for seed in range(50):
        turn = np.random.default_rng(seed).uniform(-3, 3, 3)
        T = looking_down([0.5, -0.1, 0.4], turn[0]) @ transform(rotation_x(turn[1]), [0, 0, 0])
        check_pose(T.round(4), "T")
        check_pose(T.astype(np.float32), "T")
