from dataclasses import replace

import numpy as np
import pytest

from mpgrasp.depth import EDGE_GAP, CameraIntrinsics, DepthFrame, crop_resize, inpaint
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import invert, look_at, looking_down, transform_points

WIDE = CameraIntrinsics(fx=60.0, fy=63.0, cx=40.2, cy=29.1, width=80, height=61)


def _plane_depth(
    intrinsics: CameraIntrinsics, T_world_camera: np.ndarray, normal: np.ndarray, offset: float
) -> np.ndarray:
    """Exact z-depth (H, W) of the plane normal . p = offset, pixel by pixel."""
    depth = np.empty((intrinsics.height, intrinsics.width))
    for v in range(intrinsics.height):
        for u in range(intrinsics.width):
            ray = np.array([(u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy, 1.0])
            depth[v, u] = (offset - normal @ T_world_camera[:3, 3]) / (normal @ T_world_camera[:3, :3] @ ray)
    return depth.astype(np.float32)


def _flat_frame(yaw: float = 0.3, intrinsics: CameraIntrinsics = WIDE) -> DepthFrame:
    depth = np.full((intrinsics.height, intrinsics.width), 0.5, np.float32)
    return DepthFrame(depth=depth, intrinsics=intrinsics, T_world_camera=looking_down([0.4, 0.1, 0.5], yaw))


@pytest.mark.parametrize("yaw", [-2.0, 0.0, 0.7])
def test_pixels_of_the_world_points_are_the_pixels(yaw: float) -> None:
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.2, 0.6, (61, 80)).astype(np.float32)
    T = looking_down([0.5, -0.1, 0.4], yaw) @ look_at([0, 0, 0], [0.1, 0.2, 1.0])
    frame = DepthFrame(depth=depth, intrinsics=WIDE, T_world_camera=T)
    v, u = np.indices(depth.shape)
    np.testing.assert_allclose(frame.pixels(frame.world_points()), np.stack([u, v], -1), atol=1e-4)


@pytest.mark.parametrize("yaw", [-2.0, 0.0, 0.7])
@pytest.mark.parametrize(("crop", "size"), [(47, 31), (60, 60), (50, 75), (35, 7)])
def test_world_points_through_crop_and_resize_lie_on_the_plane_where_the_pixel_looks(
    yaw: float, crop: int, size: int
) -> None:
    T = looking_down([0.5, -0.1, 0.4], yaw) @ look_at([0, 0, 0], [0.1, 0.2, 1.0])
    normal, offset = np.array([0.05, -0.08, 1.0]), 0.02
    frame = DepthFrame(
        depth=_plane_depth(WIDE, T, normal, offset), intrinsics=WIDE, T_world_camera=T, time=1.5
    )
    small = crop_resize(frame, crop, size)
    assert small.depth.shape == (size, size)
    assert small.depth.dtype == np.float32
    assert small.time == 1.5
    points = small.world_points()
    coarse = 3e-3 if crop / size > 3 else 1.5e-3 if size > crop else 1e-3  # a large pixel averages a curve
    np.testing.assert_allclose(points @ normal, offset, atol=coarse)
    # eq. 3 both ways: the new pixel is where the old camera sees that point
    v, u = np.indices(small.depth.shape)
    old = frame.pixels(points)
    left, top = (80 - crop) // 2, (61 - crop) // 2
    np.testing.assert_allclose(old[..., 0], left + (u + 0.5) * crop / size - 0.5, atol=1e-4)
    np.testing.assert_allclose(old[..., 1], top + (v + 0.5) * crop / size - 0.5, atol=1e-4)
    np.testing.assert_allclose(small.pixels(points), np.stack([u, v], -1), atol=1e-4)


def test_crop_to_the_same_size_is_a_copy_of_the_centre() -> None:
    rng = np.random.default_rng(1)
    frame = replace(_flat_frame(), depth=rng.uniform(0.3, 0.5, (61, 80)).astype(np.float32))
    small = crop_resize(frame, 41, 41)
    np.testing.assert_array_equal(small.depth, frame.depth[10:51, 19:60])
    small.depth[:] = 0
    assert frame.depth.min() > 0


def test_resize_invents_no_depth_between_surfaces() -> None:
    frame = _flat_frame()
    frame.depth[:, 33:] = 0.4
    frame.depth[20:25, :] = 0.45
    small = crop_resize(frame, 60, 37)
    for z in np.unique(small.depth):
        assert min(abs(z - level) for level in (0.4, 0.45, 0.5)) < 1e-6


def test_a_stick_4_mm_high_and_3_px_wide_keeps_its_height() -> None:
    big = CameraIntrinsics(fx=385, fy=385, cx=319.5, cy=239.5, width=640, height=480)
    frame = _flat_frame(intrinsics=big)
    frame.depth[200:280, 300:303] -= 0.004
    small = crop_resize(frame)
    rows = slice(100, 120)
    assert np.median(small.depth[rows].min(axis=1)) == pytest.approx(0.496, abs=1e-5)


def test_resize_averages_noise_away() -> None:
    rng = np.random.default_rng(2)
    frame = _flat_frame()
    frame.depth[:] += rng.normal(0, 1e-3, frame.depth.shape).astype(np.float32)
    assert crop_resize(frame, 60, 30).depth.std() == pytest.approx(0.5e-3, rel=0.1)


def test_holes_neither_spread_nor_vanish_in_resize() -> None:
    frame = _flat_frame()
    frame.depth[20:40, 30:50] = np.nan
    small = crop_resize(frame, 60, 40)
    assert np.isnan(small.depth).mean() == pytest.approx(400 / 3600, rel=0.15)
    assert np.nanmax(np.abs(small.depth - 0.5)) < 1e-6


@pytest.mark.parametrize(("old", "size"), [(40, 26), (37, 12), (24, 30)])
def test_resize_takes_the_mean_of_what_lies_near_the_centre(old: int, size: int) -> None:
    """Pixel by pixel and overlap by overlap, as the docstring says it."""
    rng = np.random.default_rng(old)
    depth = (0.5 + rng.normal(0, 1e-3, (old, old))).astype(np.float32)
    depth[5:15, 10:18] -= 0.05  # an object
    depth[12:, 20:] += np.arange(old - 20, dtype=np.float32) * 0.006  # a slope that crosses the gap
    depth[rng.random((old, old)) < 0.05] = np.nan
    frame = _flat_frame(intrinsics=CameraIntrinsics(fx=50, fy=50, cx=1, cy=1, width=old, height=old))
    small = crop_resize(replace(frame, depth=depth), old, size).depth
    side = old / size
    for row, col in np.ndindex(size, size):
        centre = depth[int((row + 0.5) * side), int((col + 0.5) * side)]
        total = mass = 0.0
        for i, j in np.ndindex(old, old):
            overlap = [
                max(0.0, min(k + 1, (n + 1) * side) - max(k, n * side)) for k, n in ((i, row), (j, col))
            ]
            if overlap[0] * overlap[1] > 1e-6 and abs(depth[i, j] - centre) < EDGE_GAP:
                mass += overlap[0] * overlap[1]
                total += overlap[0] * overlap[1] * float(depth[i, j])
        expected = total / mass if mass else np.nan
        assert small[row, col] == pytest.approx(expected, abs=1e-6, nan_ok=True), (row, col)


def test_colour_is_cropped_with_the_depth() -> None:
    rgb = np.zeros((61, 80, 3), np.uint8)
    rgb[:, 40:] = 255
    small = crop_resize(replace(_flat_frame(), rgb=rgb), 60, 30)
    assert small.rgb is not None
    assert small.rgb.shape == (30, 30, 3)
    assert small.rgb[:, :14].max() == 0
    assert small.rgb[:, 16:].min() == 255


@pytest.mark.parametrize(("crop", "size"), [(62, 10), (0, 10), (20, 0), (-3, 10)])
def test_impossible_crops_are_refused(crop: int, size: int) -> None:
    with pytest.raises(ConfigError, match="px"):
        crop_resize(_flat_frame(), crop, size)


def test_inpaint_fills_every_hole_and_keeps_every_depth() -> None:
    rng = np.random.default_rng(3)
    depth = rng.uniform(0.4, 0.42, (40, 56)).astype(np.float32)
    holes = rng.random(depth.shape) < 0.2
    holes[10:20, 10:22] = holes[:3] = holes[:, -4:] = True
    depth[holes] = np.nan
    before = depth.copy()
    filled = inpaint(depth)
    assert np.isfinite(filled).all()
    np.testing.assert_array_equal(filled[~holes], depth[~holes])
    assert filled.min() > 0.38
    assert filled.max() < 0.44
    np.testing.assert_array_equal(depth, before)


def test_inpaint_of_a_flat_surface_is_flat() -> None:
    depth = np.full((30, 41), 0.5, np.float32)
    depth[12:20, 5:30] = np.nan
    depth[-2:] = np.nan
    np.testing.assert_allclose(inpaint(depth), 0.5, atol=1e-3)


def test_inpaint_of_nothing_is_nothing() -> None:
    nothing = np.full((5, 7), np.nan, np.float32)
    assert np.isnan(inpaint(nothing)).all()
    whole = np.ones((5, 7), np.float32)
    np.testing.assert_array_equal(inpaint(whole), whole)
    assert inpaint(whole) is not whole


def test_frames_of_the_wrong_size_are_refused() -> None:
    with pytest.raises(ConfigError, match="size"):
        DepthFrame(depth=np.zeros((3, 4), np.float32), intrinsics=WIDE, T_world_camera=np.eye(4))


def test_transform_and_projection_agree_with_a_pinhole_by_hand() -> None:
    frame = _flat_frame(yaw=0.0)
    # 0.5 m below the camera, 0.1 m along world x and 0.05 m along world y: right and up in the image
    u, v = frame.pixels(np.array([0.5, 0.15, 0.0]))
    assert (u, v) == pytest.approx((40.2 + 60 * 0.2, 29.1 - 63 * 0.1))
    camera = transform_points(invert(frame.T_world_camera), np.array([0.5, 0.15, 0.0]))
    np.testing.assert_allclose(camera, [0.1, -0.05, 0.5], atol=1e-12)
