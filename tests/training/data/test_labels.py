"""Laws of the stored labels: they lead back to the object, and packing loses no more than a step."""

from __future__ import annotations

import numpy as np
import pytest
from height_maps import Solid, height_map

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors.antipodal.analysis import antipodal_grasps
from mpgrasp.geometry import line_angle_difference, looking_down, transform_points
from mpgrasp.grasp import image_to_world_angle
from mpgrasp.training.data.labels import (
    ANGLE_UNIT,
    DEPTH_UNIT,
    LABEL_HAND,
    ViewLabels,
    decode_angle,
    decode_depth,
    encode_angle,
    encode_depth,
    view_labels,
    without,
)

STICK = Solid(x=0.51, y=0.02, yaw=-0.5, length=0.09, breadth=0.024, height=0.02)


@pytest.mark.parametrize("yaw", [0.0, 1.3, -2.4])
def test_labels_lead_back_to_the_object_s_centre_line(yaw: float) -> None:
    truth = height_map(STICK)
    intrinsics = CameraIntrinsics(fx=246.4, fy=246.4, cx=111.5, cy=111.5, width=224, height=224)
    T = looking_down([0.49, 0.0, 0.35], yaw)
    # the stick's top is what matters: a flat world at its height
    depth = np.full((224, 224), 0.35 - STICK.height, np.float32)
    frame = DepthFrame(depth=depth, intrinsics=intrinsics, T_world_camera=T)
    labels = view_labels(antipodal_grasps(truth), frame)
    rows, cols = np.nonzero(labels.quality >= 0.9 * labels.quality.max())
    assert len(rows) > 5
    z = np.full(len(rows), 0.33)
    world = transform_points(T, intrinsics.deproject(cols.astype(float), rows.astype(float), z))
    away = -(world[:, 0] - STICK.x) * np.sin(STICK.yaw) + (world[:, 1] - STICK.y) * np.cos(STICK.yaw)
    assert np.abs(away).max() < 0.005
    angle = image_to_world_angle(decode_angle(labels.angle[rows, cols]), T)
    assert line_angle_difference(angle, STICK.yaw + np.pi / 2).max() < np.deg2rad(8)
    metres = labels.width[rows, cols] * 0.33 / intrinsics.fx
    assert np.all((metres > 0.022) & (metres < 0.034))
    assert labels.object_mask[rows, cols].all()
    assert 0 < labels.object_mask.mean() < 0.5


def test_grasps_where_the_depth_is_not_believed_are_left_out_and_no_others() -> None:
    rng = np.random.default_rng(0)
    maps = {k: rng.integers(1, 255, (20, 30)).astype(np.uint8) for k in ("quality", "angle", "width")}
    labels = ViewLabels(**maps, object_mask=np.ones((20, 30), np.uint8))
    spoilt = rng.random((20, 30)) < 0.3
    left = without(labels, spoilt)
    for name, nothing in (("quality", 0), ("angle", 128), ("width", 0)):
        assert (getattr(left, name)[spoilt] == nothing).all()
        assert (getattr(left, name)[~spoilt] == maps[name][~spoilt]).all()
    assert left.object_mask.all()


@pytest.mark.parametrize(("height", "least"), [(0.001, 0.3), (0.0015, 0.5), (0.002, 0.7), (0.006, 0.8)])
def test_thin_sticks_have_labels_too(height: float, least: float) -> None:
    stick = Solid(x=0.5, y=0.0, yaw=0.2, length=0.10, breadth=0.02, height=height)
    assert antipodal_grasps(height_map(stick), LABEL_HAND).quality.max() > least


def test_labels_open_with_room_alone_and_with_what_there_is_beside_a_neighbour() -> None:
    def opening(gap: float) -> float:
        stick = Solid(x=0.5, y=0.0, yaw=0.0, length=0.10, breadth=0.02, height=0.02)
        other = Solid(x=0.5, y=0.02 + gap, yaw=0.0, length=0.10, breadth=0.02, height=0.02)
        grasps = antipodal_grasps(height_map(stick, other), LABEL_HAND)
        truth = grasps.height_map
        x, y = (
            start + truth.cell * np.arange(n)
            for start, n in zip((truth.x0, truth.y0), truth.height.shape[::-1], strict=True)
        )
        near = np.hypot(x[None] - stick.x, y[:, None] - stick.y) < 0.012
        at = np.where(near, grasps.quality, -1).argmax()
        return float(grasps.width.ravel()[at]) + LABEL_HAND.opening_margin

    wide = 0.02 + 2 * LABEL_HAND.margin[1]
    assert opening(0.08) == pytest.approx(wide, abs=0.003)
    assert opening(0.026) < wide - 0.006


def test_angles_survive_packing_at_the_wrap_too() -> None:
    angles = np.linspace(-np.pi / 2, np.pi / 2, 1001)[:-1]
    back = decode_angle(encode_angle(angles))
    assert line_angle_difference(back, angles).max() <= ANGLE_UNIT / 2 + 1e-6
    assert back.min() >= -np.pi / 2 - 1e-6
    assert back.max() < np.pi / 2


def test_depth_survives_packing_and_holes_stay_holes() -> None:
    depth = np.array([[0.2, 0.56789, np.nan], [1.0, 3.0, np.nan]], np.float32)
    back = decode_depth(encode_depth(depth))
    assert np.array_equal(np.isnan(back), np.isnan(depth))
    assert np.nanmax(np.abs(back - depth)) <= DEPTH_UNIT / 2 + 1e-6
