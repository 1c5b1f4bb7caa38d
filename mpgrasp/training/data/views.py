"""One training scene: its lifted grasps, and what a camera anywhere over the workspace sees of it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.camera.noise import DepthNoise
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import CROP, NETWORK_SIZE, CameraIntrinsics, crop_resize
from mpgrasp.detectors.antipodal.analysis import antipodal_grasps
from mpgrasp.exceptions import ConfigError, SimulationError
from mpgrasp.geometry import FloatArray, looking_down, rotation_x, rotation_z, transform
from mpgrasp.height_map import HeightMap
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.training.data.appearance import randomise_appearance
from mpgrasp.training.data.generate_config import GenerateConfig
from mpgrasp.training.data.labels import LABEL_HAND, QUALITY_UNIT, encode_depth, view_labels, without
from mpgrasp.training.data.random_objects import training_scene_config
from mpgrasp.training.data.sensors import BASELINE, bad_border, random_sensor, waves
from mpgrasp.training.data.verification import verify
from mpgrasp.workspace import WORKSPACE_CENTRE

META_COLUMNS = (
    "camera_height", "scene", "max_thickness", "n_objects", "thin", "cloth_unevenness", "best_quality",
    "camera_x", "camera_y", "turn_x", "turn_y", "turn_z",
)  # fmt: skip
"""Columns of a shard's `meta`: camera over the table [m]; index of the scene; tallest point over cloth [m];
objects in the scene; 1 if nothing rises above 13 mm; cloth's RMS [m]; best label quality in the view; world
x and y of the camera [m] and the rotation vector from the camera's (OpenCV) axes to the world's [rad]."""
CAMERA_OVER_TCP = 0.0634
"""Height of the wrist camera over the tool point [m]."""
CAMERA_HEIGHT = (0.175 + CAMERA_OVER_TCP, 0.50 + CAMERA_OVER_TCP)
"""Camera over the table while the tool is between z_min and z_max [m]."""
ELSEWHERE = 0.12
"""Share of the views that look at a random spot of the workspace instead of at an object."""
LOOK_ASIDE = 0.7
"""An object aimed at lies up to this share of half the field of view off the image's centre."""
TILT = np.deg2rad(2.5)
"""Standard deviation of the camera's tilt about each axis [rad], cut at twice that: a wrist is never quite
upright, and its calibration is off."""
THIN = 0.013
"""Scenes that rise no higher over the cloth count as thin [m]."""

_LOOK, _LIFTS = 1, 2  # streams of a scene beside the one for shapes and views


def make_scene(seed: int, index: int) -> tuple[Scene, np.random.Generator]:
    """Build scene `index` of the data set `seed`, with light and colours, and the generator for its views."""
    rng = np.random.default_rng([seed, index])
    for _ in range(20):
        scene_config, scene_seed = training_scene_config(rng), int(rng.integers(2**31))
        try:
            scene = build_scene(scene_config, scene_seed, robot=False)
        except (ConfigError, SimulationError):
            continue  # found no rest in their region, or more contacts than memory for them: draw others
        randomise_appearance(scene, np.random.default_rng([seed, index, _LOOK]))
        return scene, rng
    raise ConfigError("no scene came to rest in 20 draws", got=f"seed {seed}, scene {index}")


def make_views(config: GenerateConfig, index: int) -> dict[str, np.ndarray]:
    """Return arrays of one shard's rows for one scene: (views, ...), and `trials` (m, ...)."""
    scene, rng = make_scene(config.seed, index)
    truth = scene.height_map()
    verified = verify(
        scene,
        antipodal_grasps(truth, LABEL_HAND),
        np.random.default_rng([config.seed, index, _LIFTS]),
        index=index,
    )
    above = truth.height - truth.support
    thickness = float(above[truth.label > 0].max(initial=0.0))
    data = scene.data()
    widest = DepthNoise(baseline=BASELINE[1])  # its shadows need the widest margin
    camera = WristCamera(scene.model, config.camera, widest, crop=CROP, colour=config.colour)
    shape = camera.image.height, camera.image.width
    scale = camera.image.fx / widest.focal_px
    rows: dict[str, list[np.ndarray]] = {}
    try:
        for _ in range(config.views):
            T = camera_pose(truth, rng)
            camera.noise = random_sensor(rng)
            pattern = waves(camera.noise, shape, scale, rng)
            noisy, true = (crop_resize(frame) for frame in camera.render_both(data, T, rng, pattern))
            depth, spoilt = bad_border(noisy.depth, rng)
            labels = without(view_labels(verified.grasps, true), spoilt)
            meta = (
                T[2, 3], index, thickness, len(scene.objects), thickness < THIN,
                scene.config.cloth_unevenness, labels.quality.max() * QUALITY_UNIT,
                *T[:2, 3], *cv2.Rodrigues(T[:3, :3])[0][:, 0],
            )  # fmt: skip
            row = dict(vars(labels), depth=encode_depth(depth), meta=np.array(meta, np.float32))
            if noisy.rgb is not None:
                row["rgb"] = noisy.rgb
            for name, value in row.items():
                rows.setdefault(name, []).append(value)
    finally:
        camera.close()
    return {name: np.stack(values) for name, values in rows.items()} | {"trials": verified.trials}


def camera_pose(truth: HeightMap, rng: np.random.Generator) -> FloatArray:
    """Draw `T_world_camera` (4, 4) anywhere between z_min and z_max, mostly with an object in sight."""
    height = rng.uniform(*CAMERA_HEIGHT)
    half_view = height * CROP / 2 / D435_INTRINSICS.fx
    label = rng.choice(np.unique(truth.label[truth.label > 0])) if truth.label.any() else 0
    if rng.random() < ELSEWHERE or label == 0:
        xy = WORKSPACE_CENTRE + rng.uniform(-0.3, 0.3, 2)
    else:
        row, col = np.argwhere(truth.label == label).mean(axis=0)
        target = np.array([truth.x0 + col * truth.cell, truth.y0 + row * truth.cell])
        xy = target + rng.uniform(-1, 1, 2) * half_view * LOOK_ASIDE
    T = looking_down([*xy, height], rng.uniform(-np.pi, np.pi))
    tilt = np.clip(rng.normal(0, TILT, 2), -2 * TILT, 2 * TILT)
    # tilting about x and then, a quarter turn on, about y
    T[:3, :3] = (
        T[:3, :3] @ rotation_x(tilt[0]) @ rotation_z(np.pi / 2) @ rotation_x(tilt[1]) @ rotation_z(-np.pi / 2)
    )
    return T


def stored_pose(meta: ArrayLike, columns: Sequence[str] = META_COLUMNS) -> FloatArray:
    """Return `T_world_camera` (4, 4) of a view, from its row of `meta`."""
    value = dict(zip(columns, np.asarray(meta, float), strict=True))
    turn = np.array([value[f"turn_{axis}"] for axis in "xyz"])
    return transform(cv2.Rodrigues(turn)[0], [value["camera_x"], value["camera_y"], value["camera_height"]])


def stored_intrinsics() -> CameraIntrinsics:
    """Return the intrinsics of the images in shards."""
    return D435_INTRINSICS.centre_crop(CROP).resize(NETWORK_SIZE, NETWORK_SIZE)
