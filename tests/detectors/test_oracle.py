"""Laws of the oracle: its top pixel is the analysis's best grasp, from any view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from height_maps import Solid, height_map

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors.antipodal.analysis import antipodal_grasps
from mpgrasp.detectors.config import OracleConfig
from mpgrasp.detectors.oracle import OracleDetector
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import Grasp, best_pixel
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


def top(truth: HeightMap) -> Grasp:
    """Return the grasp of the top pixel in a view from straight above."""
    oracle = OracleDetector()
    oracle.reset(truth)
    grasps = oracle.predict(frame_of(truth, looking_down([0.5, 0.0, 0.4])))
    return grasps.grasp_at(*best_pixel(grasps.quality))


@pytest.mark.parametrize("thickness", [0.001, 0.0015, 0.002])
def test_it_claims_sticks_that_the_labels_leave_out(thickness: float) -> None:
    truth = height_map(Solid(x=0.5, y=0.0, yaw=0.3, length=0.06, breadth=0.018, height=thickness))
    assert antipodal_grasps(truth).quality.max() < 0.6
    grasp = top(truth)
    assert grasp.quality > 0.6
    assert np.hypot(*(grasp.position[:2] - (0.5, 0.0))) < 0.008


def test_of_thin_places_it_takes_the_one_where_the_tips_land_low() -> None:
    stick = Solid(x=0.5, y=0.0, yaw=np.pi / 2, length=0.06, breadth=0.018, height=0.0015)
    truth = height_map(stick)
    # a crest of the cloth beside one half of the stick, as high as the stick
    crest = (truth.label == 0) & (np.arange(truth.height.shape[0])[:, None] * truth.cell + truth.y0 > 0.0)
    raised = replace(truth, height=truth.height + 0.0015 * crest, support=truth.support + 0.0015 * crest)
    assert top(raised).position[1] < -0.005


def test_it_opens_wider_where_the_tips_would_land_on_crests_beside_a_thin_thing() -> None:
    stick = Solid(x=0.5, y=0.0, yaw=np.pi / 2, length=0.06, breadth=0.018, height=0.0015)
    truth = height_map(stick)
    beside = np.abs(np.arange(truth.height.shape[1]) * truth.cell + truth.x0 - 0.5)
    # a slope that rises towards the stick: farther out the tips get lower, but not below it
    slope = np.clip(0.0006 - np.abs(beside - 0.022) * 0.06, 0, None) * (truth.label == 0)
    assert top(truth).width < 0.03
    assert top(replace(truth, height=truth.height + slope)).width > top(truth).width + 0.01


def test_what_is_too_wide_and_too_slanted_as_a_whole_is_taken_by_its_top() -> None:
    block = height_map(Solid(x=0.5, y=0.0, yaw=0.0, length=0.1, breadth=0.1, height=0.046))
    rows, cols = np.indices(block.height.shape)
    aside = np.maximum(
        np.abs(cols * block.cell + block.x0 - 0.5), np.abs(rows * block.cell + block.y0)
    )  # from the middle of a bowl upside down, whose foot is 50 mm wide
    wall = np.clip(0.046 - 0.9 * np.clip(aside - 0.025, 0, None), 0, None) * (block.label > 0)
    bowl = replace(block, height=wall)
    assert antipodal_grasps(bowl, OracleConfig()).quality.max() < 0.05
    assert top(block).quality == 0
    grasp = top(bowl)
    assert grasp.quality > 0.2
    assert np.hypot(*(grasp.position[:2] - (0.5, 0.0))) < 0.012
    # 3 mm below its rim the foot is 50 + 2 * 3 / 0.9 mm wide; and a cell of 2 mm
    assert 0.045 < grasp.width < 0.059
