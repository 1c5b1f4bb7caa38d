"""The wrist camera: both backends see the same, where geometry says, and colour where there is GL."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from toy_world import POSES, SMALL, World, edges_of, needs_gl, toy_world, true_frame

from mpgrasp.camera import rasteriser
from mpgrasp.camera import wrist_camera as camera_module
from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.camera.noise import DepthNoise
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import crop_resize
from mpgrasp.exceptions import CameraError, ConfigError
from mpgrasp.geometry import looking_down, transform

BACKENDS = [pytest.param("gl", marks=needs_gl), "ray"]


@pytest.fixture(scope="module")
def world() -> World:
    return toy_world()


@needs_gl
@pytest.mark.parametrize("pose", range(3))
def test_both_backends_see_the_same_within_a_millimetre_away_from_edges(world: World, pose: int) -> None:
    model, data = world
    drawn = WristCamera(model, "gl", None).render(data, POSES[pose]).depth
    cast = WristCamera(model, "ray", None).render(data, POSES[pose]).depth
    edges = edges_of(cast)
    assert edges.mean() < 0.06
    error = np.abs(drawn - cast)
    np.testing.assert_array_equal(np.isnan(drawn), np.isnan(cast))
    assert np.nanmax(error[~edges]) < 1e-3
    assert np.nanmedian(error) < 2e-5
    assert np.nanmean(error > 1e-3) < 1e-3  # nor do edges lie elsewhere


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("crop", [None, 90])
def test_depth_of_a_slanted_plane_is_exact_at_every_pixel_centre(backend: str, crop: int | None) -> None:
    # 30 degrees: half a pixel of offset would be 1 mm of depth
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="9 9 1" euler="30 0 0"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    normal = np.array([0.0, -0.5, np.sqrt(0.75)])
    camera = WristCamera(model, backend, None, intrinsics=SMALL, crop=crop)
    for yaw in (-2.0, 0.0, 0.7):
        frame = camera.render(data, looking_down([0.1, 0.05, 0.5], yaw))
        T, i = frame.T_world_camera, frame.intrinsics
        assert frame.depth.shape == ((120, 160) if crop is None else (90, 90))
        assert (i.cx, i.cy) == ((81.0, 57.3) if crop is None else (46.0, 42.3))
        v, u = np.indices(frame.depth.shape)
        rays = np.stack([(u - i.cx) / i.fx, (v - i.cy) / i.fy, np.ones(u.shape)], -1) @ T[:3, :3].T
        expected = -(normal @ T[:3, 3]) / (rays @ normal)
        np.testing.assert_allclose(frame.depth, expected, atol=5e-6)
        np.testing.assert_allclose(frame.world_points() @ normal, 0, atol=5e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_box_edge_lies_where_projection_puts_it(backend: str) -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="9 9 1"/>'
        '<geom type="box" size=".05 .03 .01" pos=".02 .01 .01"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = WristCamera(model, backend, None, intrinsics=SMALL)
    for shift in np.linspace(0, 0.003, 7):  # a pixel is 3 mm here
        frame = camera.render(data, looking_down([shift, 0.0, 0.42]))
        left, top = frame.pixels(np.array([-0.03, 0.04, 0.02]))
        right, bottom = frame.pixels(np.array([0.07, -0.02, 0.02]))
        rows, cols = np.nonzero(frame.depth < 0.405)
        assert cols.min() == np.ceil(left)
        assert cols.max() == np.floor(right)
        assert rows.min() == np.ceil(top)
        assert rows.max() == np.floor(bottom)


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_wrist_pose_is_the_mujoco_camera_with_opencv_axes(world: World, backend: str) -> None:
    model, data = world
    camera = WristCamera(model, backend, None)
    frame = true_frame(camera, data)
    mat = data.cam_xmat[0].reshape(3, 3)
    expected = transform(np.column_stack([mat[:, 0], -mat[:, 1], -mat[:, 2]]), data.cam_xpos[0])
    np.testing.assert_allclose(frame.T_world_camera, expected, atol=1e-12)
    assert frame.time == 2.5
    assert frame.intrinsics == D435_INTRINSICS
    # every point lies on the surface that a single ray from elsewhere finds there
    rng = np.random.default_rng(0)
    points = frame.world_points()
    flat = ~edges_of(frame.depth)
    rows, cols = np.nonzero(flat)
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    for k in rng.integers(len(rows), size=50):
        p = points[rows[k], cols[k]]
        start, geom = p + np.array([0, 0, 0.05]), np.zeros(1, np.int32)
        distance = mujoco.mj_ray(model, data, start, np.array([0, 0, -1.0]), groups, True, -1, geom)
        assert distance == pytest.approx(0.05, abs=1.5e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_hidden_groups_invisible_geoms_sites_and_near_things_are_not_seen(world: World, backend: str) -> None:
    model, data = world
    # the camera's own housing lies within the near plane; the two boxes and the site below are never seen
    depth = true_frame(WristCamera(model, backend, None), data).depth
    assert np.nanmin(depth) > 0.35
    hidden = WristCamera(model, backend, None, geom_groups=(3,)).render(data, looking_down([0, 0, 0.5])).depth
    assert hidden[240, 320] == pytest.approx(0.18, abs=1e-5)
    assert np.isnan(hidden[0, 0])


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_crop_is_the_window_of_the_whole_image(world: World, backend: str) -> None:
    model, data = world
    whole = true_frame(WristCamera(model, backend, None), data)
    part = true_frame(WristCamera(model, backend, None, crop=350), data)
    window = whole.depth[65:415, 145:495]
    edges = edges_of(window)
    np.testing.assert_allclose(part.depth[~edges], window[~edges], atol=1e-5)
    assert part.intrinsics == whole.intrinsics.crop(65, 145, 350, 350)
    np.testing.assert_allclose(crop_resize(part).depth, crop_resize(whole).depth, atol=2e-2)
    assert crop_resize(part).intrinsics == crop_resize(whole).intrinsics


@pytest.mark.parametrize("backend", BACKENDS)
def test_same_seed_gives_the_same_bytes_and_no_noise_means_none(world: World, backend: str) -> None:
    model, data = world
    camera = WristCamera(model, backend, crop=200)
    frames = [camera.capture(data, np.random.default_rng(s)).depth for s in (0, 0, 1)]
    assert frames[0].tobytes() == frames[1].tobytes() != frames[2].tobytes()
    assert frames[0].shape == (200, 200)
    truth = true_frame(camera, data).depth
    error = frames[0] - truth
    assert 3e-4 < np.nanstd(error[~edges_of(truth)]) < 2e-3
    quiet = WristCamera(model, backend, None, crop=200).capture(data, np.random.default_rng(0))
    edges = edges_of(truth)
    np.testing.assert_allclose(quiet.depth[~edges], truth[~edges], atol=1e-5)


def test_shadows_at_the_crop_s_right_border_come_from_outside_of_it() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="9 9 1"/>'
        '<geom type="box" size=".05 .3 .04" pos=".167 0 .04"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    noise = DepthNoise(subpixel=0, disparity_step=0)
    camera = WristCamera(model, "ray", noise, crop=200)
    depth = camera.render(data, looking_down([0, 0, 0.5]), np.random.default_rng(0)).depth
    left_edge = camera.intrinsics.cx + 385 * 0.117 / 0.42
    assert 200 < left_edge < 210  # the box itself is outside of the crop
    shadow = 385 * 0.05 * (1 / 0.42 - 1 / 0.5)
    assert np.isnan(depth[100]).sum() == pytest.approx(200 - (left_edge - shadow), abs=1)


@needs_gl
def test_colour_images_have_the_geometry_of_the_frames(world: World) -> None:
    model, data = world
    camera = WristCamera(model, "gl", None, intrinsics=SMALL)
    rgb = camera.rgb(data)
    assert rgb.shape == (120, 160, 3)
    assert rgb.dtype == np.uint8
    assert rgb.std() > 5
    camera.close()


@needs_gl
@pytest.mark.parametrize("crop", [None, 100])
def test_coloured_frames_show_in_colour_what_they_show_in_depth(world: World, crop: int | None) -> None:
    model, data = world
    plain, coloured = (
        WristCamera(model, "gl", intrinsics=SMALL, crop=crop, colour=colour) for colour in (False, True)
    )
    frames = [c.capture(data, np.random.default_rng(0)) for c in (plain, coloured)]
    assert frames[0].rgb is None
    rgb = frames[1].rgb
    assert rgb is not None
    assert rgb.shape == (*frames[1].depth.shape, 3)
    assert rgb.dtype == np.uint8
    assert np.array_equal(frames[0].depth, frames[1].depth, equal_nan=True)
    true = true_frame(coloured, data).depth
    # where depth jumps there is an edge in colour too, more often than elsewhere
    jump = np.abs(np.diff(true, axis=1)) > 0.01
    step = np.abs(np.diff(rgb.astype(int).sum(axis=2), axis=1))
    assert step[jump].mean() > 3 * step[~jump].mean()
    plain.close()
    coloured.close()


@needs_gl
def test_reported_and_true_image_of_one_look_are_those_of_two(world: World) -> None:
    model, data = world
    camera = WristCamera(model, "gl", intrinsics=SMALL, crop=100)
    T = camera.pose(data)
    reported, true = camera.render_both(data, T, np.random.default_rng(4))
    assert np.array_equal(
        reported.depth, camera.render(data, T, np.random.default_rng(4)).depth, equal_nan=True
    )
    assert np.array_equal(true.depth, camera.render(data, T).depth, equal_nan=True)
    camera.close()


@needs_gl
def test_the_crop_and_resize_of_colour_follow_those_of_depth(world: World) -> None:
    model, data = world
    camera = WristCamera(model, "gl", None, intrinsics=SMALL, colour=True)
    image = crop_resize(true_frame(camera, data), crop=100, size=50)
    assert image.rgb is not None
    assert image.rgb.shape == (50, 50, 3)
    whole = true_frame(camera, data).rgb
    assert whole is not None
    mean = whole[10:110, 30:130].reshape(50, 2, 50, 2, 3).mean(axis=(1, 3))
    assert np.abs(image.rgb - mean).max() <= 1
    camera.close()


def test_colour_without_gl_is_refused(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CameraError, match="no colour"):
        WristCamera(world[0], "ray", colour=True)
    monkeypatch.setattr(rasteriser, "_gl_error", lambda: CameraError("broken"))
    with pytest.raises(CameraError, match="broken"):
        WristCamera(world[0], "auto", colour=True)


@pytest.fixture
def _no_gl(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def refuse() -> None:
        raise CameraError("OpenGL cannot be initialised", allowed="a machine with EGL")

    monkeypatch.setattr(camera_module, "require_gl", refuse)
    camera_module._gl_or_notice.cache_clear()
    yield
    camera_module._gl_or_notice.cache_clear()


@pytest.mark.usefixtures("_no_gl")
def test_without_gl_auto_casts_rays_and_says_so_once(world: World, caplog: pytest.LogCaptureFixture) -> None:
    model, data = world
    with caplog.at_level(logging.WARNING):
        cameras = [WristCamera(model, "auto", None, intrinsics=SMALL) for _ in range(3)]
    assert [c.backend for c in cameras] == ["ray"] * 3
    assert len(caplog.records) == 1
    assert np.isfinite(true_frame(cameras[0], data).depth).any()
    with pytest.raises(CameraError, match="EGL"):
        WristCamera(model, "gl")


def test_unknown_backends_cameras_and_crops_are_refused(world: World) -> None:
    model, data = world
    with pytest.raises(ConfigError, match="auto, gl, ray"):
        WristCamera(model, "vulkan")
    with pytest.raises(ConfigError, match="1 to 480"):
        WristCamera(model, "ray", crop=481)
    with pytest.raises(CameraError, match="panda/wrist"):
        WristCamera(mujoco.MjModel.from_xml_string("<mujoco/>"), "ray").pose(data)
