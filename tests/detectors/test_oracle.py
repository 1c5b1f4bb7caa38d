"""Laws of the oracle: its top pixel is the analysis's best grasp, from any view."""

from __future__ import annotations

import numpy as np
import pytest
from height_maps import Solid, height_map

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors.oracle import OracleDetector
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import best_pixel
from mpgrasp.height_map import HeightMap

INTRINSICS = CameraIntrinsics(fx=385.0, fy=385.0, cx=319.5, cy=239.5, width=640, height=480)
STICK = Solid(x=0.52, y=-0.03, yaw=0.3, length=0.08, breadth=0.02, height=0.008)


def frame_of(truth: HeightMap, T: FloatArray) -> DepthFrame:
    """Depth of a camera that looks straight down, by fixed-point search along each ray."""
    v, u = np.indices((480, 640)).astype(float)
    z = np.full(u.shape, T[2, 3])
    for _ in range(4):
        camera = INTRINSICS.deproject(u, v, z)
        world = camera @ T[:3, :3].T + T[:3, 3]
        row, col, inside = truth.cells(world[..., 0], world[..., 1])
        z = T[2, 3] - np.where(inside, truth.height[row, col], 0.0)
    return DepthFrame(depth=z.astype(np.float32), intrinsics=INTRINSICS, T_world_camera=T)


@pytest.mark.parametrize("yaw", [0.0, 0.9, -2.0])
@pytest.mark.parametrize("height", [0.25, 0.55])
def test_the_top_pixel_is_the_stick_s_middle_from_any_view(yaw: float, height: float) -> None:
    truth = height_map(STICK)
    oracle = OracleDetector()
    oracle.reset(truth)
    grasps = oracle.predict(frame_of(truth, looking_down([0.50, 0.01, height], yaw)))
    assert grasps.quality.shape == (224, 224)
    grasp = grasps.grasp_at(*best_pixel(grasps.quality))
    assert grasp.quality > 0.6
    assert np.hypot(*(grasp.position[:2] - (STICK.x, STICK.y))) < 0.008
    assert abs(grasp.position[2] - STICK.height) < 0.002
    assert line_angle_difference(grasp.angle, STICK.yaw + np.pi / 2) < np.deg2rad(5)
    assert 0.018 < grasp.width < 0.032


def test_pixels_without_depth_have_no_grasp() -> None:
    truth = height_map(STICK)
    oracle = OracleDetector()
    oracle.reset(truth)
    frame = frame_of(truth, looking_down([0.52, -0.03, 0.4]))
    frame.depth[200:280, 280:360] = np.nan
    assert not oracle.predict(frame).quality.any()


def test_an_empty_table_and_a_blind_camera_give_no_grasp() -> None:
    oracle = OracleDetector()
    oracle.reset(height_map())
    frame = frame_of(height_map(), looking_down([0.5, 0.0, 0.4]))
    assert not oracle.predict(frame).quality.any()
    frame.depth[:] = np.nan
    assert not oracle.predict(frame).quality.any()


def test_without_a_scene_it_refuses() -> None:
    with pytest.raises(ConfigError, match="reset"):
        OracleDetector().predict(frame_of(height_map(), looking_down([0.5, 0.0, 0.4])))
