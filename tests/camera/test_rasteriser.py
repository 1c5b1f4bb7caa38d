"""Drawing through OpenGL: contexts side by side, freed and made anew, leave each other alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from toy_world import POSES, SMALL, XML, World, needs_gl, toy_world, true_frame

from mpgrasp.camera import rasteriser
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.exceptions import CameraError
from mpgrasp.geometry import looking_down


@pytest.fixture(scope="module")
def world() -> World:
    return toy_world()


@needs_gl
def test_cameras_side_by_side_do_not_disturb_each_other(world: World) -> None:
    model, data = world
    other = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><light pos="0 0 2"/><geom type="sphere" size=".1"/></worldbody></mujoco>'
    )
    other_data = mujoco.MjData(other)
    mujoco.mj_forward(other, other_data)
    first = WristCamera(model, "gl", None, intrinsics=SMALL)
    depth = true_frame(first, data).depth
    rgb = first.rgb(data)
    second = WristCamera(other, "gl", None, crop=200)
    pose = looking_down([0, 0, 0.5])
    sphere = second.render(other_data, pose).depth
    picture = second.rgb(other_data, pose)
    assert sphere[100, 100] == pytest.approx(0.4, abs=1e-3)
    for _ in range(2):
        np.testing.assert_array_equal(true_frame(first, data).depth, depth)
        np.testing.assert_array_equal(second.rgb(other_data, pose), picture)
        np.testing.assert_array_equal(first.rgb(data), rgb)
        np.testing.assert_array_equal(second.render(other_data, pose).depth, sphere)
    del second
    np.testing.assert_array_equal(true_frame(first, data).depth, depth)
    np.testing.assert_array_equal(first.rgb(data), rgb)


@needs_gl
def test_closing_frees_and_a_later_image_starts_anew(world: World) -> None:
    model, data = world
    camera = WristCamera(model, "gl", None, intrinsics=SMALL)
    first = true_frame(camera, data).depth
    camera.close()
    camera.close()
    np.testing.assert_array_equal(true_frame(camera, data).depth, first)
    camera.close()
    drawer = rasteriser.Rasteriser(model, SMALL)
    drawer.close()
    with pytest.raises(CameraError, match="closed"):
        drawer.render(data, POSES[0])


@needs_gl
def test_drawing_leaves_the_model_as_it_was(world: World) -> None:
    model, data = world
    before = mujoco.MjModel.from_xml_string(XML).vis
    true_frame(WristCamera(model, "gl", None, intrinsics=SMALL), data)
    for name in ("offsamples", "shadowsize", "numslices", "numstacks"):
        assert getattr(model.vis.quality, name) == getattr(before.quality, name)
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (640, 480)
