"""Laws of random light and colour: training scenes alone, looks alone."""

from __future__ import annotations

import numpy as np

from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import OBJECT_GROUP
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.training.data.appearance import CAMOUFLAGE, randomise_appearance

CONFIG = SceneConfig(objects=("usb_stick", "key"), half_extent=0.15)


def test_looks_vary_and_the_world_stays() -> None:
    scene, plain = (build_scene(CONFIG, 0, robot=False) for _ in range(2))
    randomise_appearance(scene, np.random.default_rng(0))
    for name in ("geom_pos", "geom_quat", "geom_size", "geom_friction", "body_mass", "hfield_data"):
        assert np.array_equal(getattr(scene.model, name), getattr(plain.model, name)), name
    assert not np.allclose(scene.model.geom_rgba, plain.model.geom_rgba)
    assert not np.allclose(scene.model.light_dir, plain.model.light_dir)
    assert scene.model.light_dir[0, 2] < 0  # from above


def test_another_scene_of_the_same_config_is_not_touched() -> None:
    before = build_scene(CONFIG, 0, robot=False).model.geom_rgba.copy()
    randomise_appearance(build_scene(CONFIG, 0, robot=False), np.random.default_rng(0))
    assert np.array_equal(build_scene(CONFIG, 0, robot=False).model.geom_rgba, before)


def test_some_scenes_hide_their_objects_by_colour() -> None:
    scene = build_scene(CONFIG, 0, robot=False)
    rng = np.random.default_rng(0)
    hidden = [_contrast(scene, rng) < 0.06 for _ in range(300)]
    assert abs(np.mean(hidden) - CAMOUFLAGE) < 0.08


def _contrast(scene: Scene, rng: np.random.Generator) -> float:
    scene.model.geom_rgba[scene.model.geom_group == OBJECT_GROUP, :3] = 0.0
    randomise_appearance(scene, rng)
    model = scene.model
    objects = model.geom_rgba[model.geom_group == OBJECT_GROUP, :3]
    return float(np.abs(objects - model.geom_rgba[model.geom("cloth").id, :3]).max(axis=1).mean())
