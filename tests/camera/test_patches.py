"""Laws of patches without return on the surfaces of objects."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from mpgrasp.camera.patches import Patches
from mpgrasp.camera.ray_caster import cast_rays
from mpgrasp.camera.standing_errors import StandingErrors
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import Scene, build_scene

IMAGE = CameraIntrinsics(fx=385.0, fy=385.0, cx=99.5, cy=79.5, width=200, height=160)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(SceneConfig(objects=("mug", "usb_stick", "bottle")), 3, robot=False)


def patches(scene: Scene, share: float, seed: int = 0, size: float = 0.01) -> Patches:
    return Patches(scene.model, scene.objects, share, size, np.random.default_rng(seed))


def over(scene: Scene, name: str, height: float = 0.4, yaw: float = 0.0, aside: float = 0.0) -> FloatArray:
    position = scene.data().body(name).xpos + np.array([aside, 0.0, height])
    return looking_down(position, yaw)


def seen(scene: Scene, T: FloatArray) -> Iterator[np.ndarray]:
    """Masks (H, W) of the pixels that see each object, by rays of their own."""
    hits = cast_rays(scene.model, scene.data(), IMAGE, T)
    for name in scene.objects:
        own = [g for g in range(scene.model.ngeom) if scene.model.geom_bodyid[g] == scene.model.body(name).id]
        yield np.isin(hits.geom, own)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_on_average_the_share_of_the_surface_that_is_asked_for_is_lost(scene: Scene, share: float) -> None:
    T = over(scene, "mug")
    (mug, *_) = seen(scene, T)
    found = [patches(scene, share, k).lost(scene.data(), IMAGE, T)[mug].mean() for k in range(16)]
    assert np.mean(found) == pytest.approx(share, abs=4 * np.std(found) / np.sqrt(16) + 0.01)


def test_nothing_but_objects_is_lost_and_with_a_share_of_one_all_of_them_is(scene: Scene) -> None:
    T = over(scene, "mug", height=0.5)
    expected = np.any(list(seen(scene, T)), axis=0)
    assert expected.sum() > 500
    np.testing.assert_array_equal(patches(scene, 1.0).lost(scene.data(), IMAGE, T), expected)


def test_two_views_miss_the_same_points_of_the_surface(scene: Scene) -> None:
    dark, data, name = patches(scene, 0.4), scene.data(), "usb_stick"
    k = scene.objects.index(name)
    body = data.body(name)
    for T in (over(scene, name), over(scene, name, height=0.25, yaw=1.1, aside=0.03)):
        lost, hits = dark.lost(data, IMAGE, T), cast_rays(scene.model, data, IMAGE, T)
        mask = list(seen(scene, T))[k]
        v, u = np.nonzero(mask)
        camera = IMAGE.deproject(u.astype(float), v.astype(float), hits.depth[mask].astype(float))
        world = camera @ T[:3, :3].T + T[:3, 3]
        local = (world - body.xpos) @ body.xmat.reshape(3, 3)
        # one field in the object's frame says it for both views; single precision moves a few at the rims
        assert np.mean(dark.is_lost(k, local) == lost[mask]) > 0.99
        assert 0.02 < lost[mask].mean() < 0.98


def test_a_patch_goes_on_as_far_as_its_size_says(scene: Scene) -> None:
    steps = np.zeros((2, 3))
    for distance in (0.005, 0.02):
        steps[1, 0] = distance
        pairs = [patches(scene, 0.5, k).is_lost(0, steps) for k in range(1500)]
        same = np.mean([a == b for a, b in pairs])
        # two Gaussian values of correlation r have the same sign with probability 1/2 + asin(r) / pi
        r = np.exp(-((distance / 0.01) ** 2) / 2)
        assert same == pytest.approx(0.5 + np.arcsin(r) / np.pi, abs=0.04)


@pytest.mark.parametrize("backend", ["ray", "auto"])
def test_a_camera_with_patches_reports_no_depth_there_and_the_same_elsewhere(
    scene: Scene, backend: str
) -> None:
    robot = build_scene(SceneConfig(objects=("mug",)), 3)
    camera, data = WristCamera(robot.model, backend, crop=200), robot.data()
    before = camera.capture(data, np.random.default_rng(0)).depth
    camera.errors = StandingErrors(patches=patches(robot, 0.5))
    after = camera.capture(data, np.random.default_rng(0)).depth
    lost = patches(robot, 0.5).lost(data, camera.image, camera.pose(data))[:, : after.shape[1]]
    assert np.isnan(after[lost]).all()
    np.testing.assert_array_equal(after[~lost], before[~lost])
    camera.close()
