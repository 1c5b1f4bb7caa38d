"""Laws of the hand-eye calibration's error, and what it does to what is believed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpgrasp.camera.config import CameraConfig
from mpgrasp.camera.standing_errors import StandingErrors, calibration_error
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import build_scene


def drawn(translation: float, rotation: float, n: int = 400) -> np.ndarray:
    errors = [calibration_error(translation, rotation, np.random.default_rng(k)) for k in range(n)]
    return np.array(errors)


def test_errors_have_the_size_that_is_asked_for() -> None:
    T = drawn(0.005, 0.02)
    np.testing.assert_allclose(np.linalg.norm(T[:, :3, 3], axis=1), 0.005, rtol=1e-12)
    np.testing.assert_allclose(Rotation.from_matrix(T[:, :3, :3]).magnitude(), 0.02, rtol=1e-6)


def test_their_directions_are_uniform() -> None:
    T = drawn(1.0, 0.1, 3000)
    axes = Rotation.from_matrix(T[:, :3, :3]).as_rotvec() / 0.1
    for directions in (T[:, :3, 3], axes):
        np.testing.assert_allclose(directions.mean(axis=0), 0, atol=0.05)
        np.testing.assert_allclose(np.cov(directions.T), np.eye(3) / 3, atol=0.03)


def test_each_of_both_leaves_the_other_as_it_is() -> None:
    both, shift, turn = drawn(0.005, 0.02, 1)[0], drawn(0.005, 0.0, 1)[0], drawn(0.0, 0.02, 1)[0]
    np.testing.assert_array_equal(both[:3, 3], shift[:3, 3])
    np.testing.assert_array_equal(both[:3, :3], turn[:3, :3])
    assert calibration_error(0.0, 0.0, np.random.default_rng(0)) is None


def test_the_image_is_the_true_one_and_points_are_believed_where_the_error_takes_them() -> None:
    scene = build_scene(SceneConfig(cloth_unevenness=0.0), 0)
    camera, data = WristCamera(scene.model, "ray", None, crop=120), scene.data()
    true = camera.capture(data, np.random.default_rng(0))
    error = calibration_error(0.004, 0.03, np.random.default_rng(7))
    assert error is not None
    camera.errors = StandingErrors(calibration=error)
    believed = camera.capture(data, np.random.default_rng(0))
    np.testing.assert_array_equal(believed.depth, true.depth)
    # the point under the optical axis at depth z: off by the shift, and by z times the sine of the turn
    z = float(true.depth[60, 60])
    moved = believed.world_points()[60, 60] - true.world_points()[60, 60]
    R, t = Rotation.from_matrix(error[:3, :3]), error[:3, 3]
    point = true.intrinsics.deproject(np.array(60.0), np.array(60.0), np.array(z))
    expected = true.T_world_camera[:3, :3] @ (R.apply(point) + t - point)
    np.testing.assert_allclose(moved, expected, atol=1e-9)
    assert 0.3 * z * 0.03 - 0.004 < np.linalg.norm(moved) < z * 0.03 + 0.0045


@pytest.mark.parametrize(
    "setting",
    [
        {"calibration_translation": -0.001}, {"calibration_translation": float("nan")},
        {"calibration_rotation": 3.0}, {"latency": -0.1}, {"latency": "fast"}, {"latency": float("inf")},
    ],
)  # fmt: skip
def test_errors_that_mean_nothing_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        CameraConfig(**setting)  # type: ignore[arg-type]
