"""Random light and colours of training scenes; evaluation scenes keep their own."""

from __future__ import annotations

import mujoco
import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.scene.objects.model import OBJECT_GROUP
from mpgrasp.scene.scene import Scene

CAMOUFLAGE = 0.25
"""Share of the scenes whose objects have the colour of the cloth, as some in the thin suite have."""
CAMOUFLAGE_ERROR = 0.02
"""Standard deviation of such a colour's channels about the cloth's."""
GREYISH = 0.5
"""Share of cloths and tables with hardly any hue."""
TWO_COLOURED = 0.25
"""Share of the objects whose parts differ in colour."""


def randomise_appearance(scene: Scene, rng: np.random.Generator) -> None:
    """Give the model of a training scene a light and colours of its own; shapes and motion stay.

    Args:
        scene: built without the robot; its model is changed in place.
        rng: source of all that is random.
    """
    model = scene.model
    _light(model, rng)
    cloth = _background(rng)
    _paint(model, "table", _background(rng))
    _paint(model, "cloth", cloth)
    camouflage = rng.random() < CAMOUFLAGE
    for name in scene.objects:
        geoms = np.flatnonzero(
            (model.geom_bodyid == model.body(name).id) & (model.geom_group == OBJECT_GROUP)
        )
        if camouflage:
            colour = np.clip(cloth + rng.normal(0, CAMOUFLAGE_ERROR, 3), 0, 1)
            model.geom_rgba[geoms, :3] = colour
        elif rng.random() < TWO_COLOURED:
            model.geom_rgba[geoms[len(geoms) // 2 :], :3] = rng.uniform(0.05, 0.95, 3)


def _light(model: mujoco.MjModel, rng: np.random.Generator) -> None:
    """A lamp somewhere above, tinted a little, and more or less light from all around."""
    lamp = model.light("ceiling").id
    azimuth, slant = rng.uniform(-np.pi, np.pi), np.deg2rad(rng.uniform(0, 60))
    model.light_dir[lamp] = [
        np.sin(slant) * np.cos(azimuth),
        np.sin(slant) * np.sin(azimuth),
        -np.cos(slant),
    ]
    model.light_diffuse[lamp] = rng.uniform(0.1, 0.8) * _tint(rng)
    model.vis.headlight.diffuse = rng.uniform(0.1, 0.5) * _tint(rng)
    model.vis.headlight.ambient = rng.uniform(0.1, 0.45) * _tint(rng)


def _tint(rng: np.random.Generator) -> FloatArray:
    return np.asarray(rng.uniform(0.85, 1.0, 3))


def _background(rng: np.random.Generator) -> FloatArray:
    colour = np.asarray(rng.uniform(0.05, 0.95, 3))
    if rng.random() < GREYISH:
        colour = np.clip(colour.mean() + rng.normal(0, 0.03, 3), 0, 1)
    return colour


def _paint(model: mujoco.MjModel, geom: str, colour: FloatArray) -> None:
    model.geom_rgba[model.geom(geom).id, :3] = colour
