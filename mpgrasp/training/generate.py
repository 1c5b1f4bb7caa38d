"""Training data: random scenes, their dense grasps, and noisy views from anywhere over the workspace.

`python -m mpgrasp.training generate --scenes 2000 --out DIR` writes shards `shard_00000.npz` of
`SHARD_SCENES` scenes each, `meta.json` that describes them and `sheet.png` to look at. A scene is a function
of the seed and its index alone, so neither the number of workers nor an interruption changes a byte;
finished shards are kept.
"""

from __future__ import annotations

import argparse
import io
import json
import multiprocessing
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import mujoco
import numpy as np

from mpgrasp.camera import BACKENDS, WristCamera
from mpgrasp.depth import CROP, NETWORK_SIZE, crop_resize
from mpgrasp.detectors.antipodal import antipodal_grasps
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.geometry import FloatArray, looking_down, rotation_x, rotation_z
from mpgrasp.height_map import HeightMap
from mpgrasp.scene import WORKSPACE_CENTRE, Scene, build_scene
from mpgrasp.training.labels import ANGLE_UNIT, DEPTH_UNIT, QUALITY_UNIT, encode_depth, view_labels
from mpgrasp.training.random_objects import training_scene_config

SHARD_SCENES = 20
"""Scenes in a shard."""
META_COLUMNS = (
    "camera_height", "scene", "max_thickness", "n_objects", "thin", "cloth_unevenness", "best_quality",
)  # fmt: skip
"""Columns of a shard's `meta`: camera over the table [m]; index of the scene; tallest point over cloth [m];
objects in the scene; 1 if nothing rises above 13 mm; cloth's RMS [m]; best label quality in the view."""
CAMERA_OVER_TCP = 0.0634
"""Height of the wrist camera over the tool point [m]."""
CAMERA_HEIGHT = (0.175 + CAMERA_OVER_TCP, 0.50 + CAMERA_OVER_TCP)
"""Camera over the table while the tool is between z_min and z_max [m]."""
ELSEWHERE = 0.12
"""Share of the views that look at a random spot of the workspace instead of at an object."""
LOOK_ASIDE = 0.7
"""An object aimed at lies up to this share of half the field of view off the image's centre."""
TILT = np.deg2rad(1.5)
"""Standard deviation of the camera's tilt about each axis [rad], cut at twice that."""
THIN = 0.013
"""Scenes that rise no higher over the cloth count as thin [m]."""
FORMAT = 1


@dataclass(frozen=True, kw_only=True)
class GenerateConfig:
    """What is generated."""

    scenes: int
    """Number of scenes."""
    seed: int = 1
    """Of the data set; scene k of a seed is the same in every set."""
    views: int = 4
    """Images of each scene."""
    camera: str = "auto"
    """Camera backend."""

    def __post_init__(self) -> None:
        for name, least in (("scenes", 1), ("views", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise ConfigError(
                    f"unusable number of {name}", got=getattr(self, name), allowed=f"{least} or more"
                )
        if self.camera not in BACKENDS:
            raise ConfigError("unknown camera backend", got=self.camera, allowed=BACKENDS)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `python -m mpgrasp.training generate`."""
    parser.add_argument("--scenes", type=int, default=1000, help="number of scenes (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where the shards go")
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the whole set (default: %(default)s)")
    parser.add_argument("--views", type=int, default=4, help="images of each scene (default: %(default)s)")
    parser.add_argument(
        "--camera", choices=BACKENDS, default="auto", help="depth backend (default: %(default)s)"
    )


def main(args: argparse.Namespace) -> int:
    """Run the command; returns the exit code."""
    config = GenerateConfig(scenes=args.scenes, seed=args.seed, views=args.views, camera=args.camera)
    generate(config, args.out, workers=args.workers)
    return 0


def generate(config: GenerateConfig, out: Path, *, workers: int = 1, progress: bool = True) -> list[Path]:
    """Write the data set; shards that are there already are kept.

    Raises:
        ConfigError: fewer than one worker, or `out` holds data of another configuration.
        OutputError: `out` cannot be written.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    if workers < 1:
        raise ConfigError("unusable number of workers", got=workers, allowed="1 or more")
    _prepare(config, out)
    starts = range(0, config.scenes, SHARD_SCENES)
    jobs = [(config, range(s, min(s + SHARD_SCENES, config.scenes)), _shard_path(out, s)) for s in starts]
    waiting = [job for job in jobs if not job[2].is_file()]
    columns = (
        "generate",
        BarColumn(),
        MofNCompleteColumn(),
        "shards",
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, disable=not progress) as bar:
        task = bar.add_task("generate", total=len(jobs), completed=len(jobs) - len(waiting))
        if workers == 1 or len(waiting) < 2:
            for job in waiting:
                _write_shard(job)
                bar.advance(task)
        else:
            # spawned, not forked: an OpenGL context does not survive a fork
            with multiprocessing.get_context("spawn").Pool(min(workers, len(waiting)), _one_thread) as pool:
                for _ in pool.imap_unordered(_write_shard, waiting):
                    bar.advance(task)
    paths = [job[2] for job in jobs]
    from mpgrasp.training.sheet import write_sheet

    write_sheet(paths[0], out / "sheet.png")
    return paths


def make_scene(seed: int, index: int) -> tuple[Scene, np.random.Generator]:
    """Scene `index` of the data set `seed`, and the generator for its views."""
    rng = np.random.default_rng([seed, index])
    for _ in range(20):
        scene_config, scene_seed = training_scene_config(rng), int(rng.integers(2**31))
        try:
            return build_scene(scene_config, scene_seed, robot=False), rng
        except (ConfigError, mujoco.FatalError):
            continue  # found no rest in their region, or more contacts than memory for them: draw others
    raise ConfigError("no scene came to rest in 20 draws", got=f"seed {seed}, scene {index}")


def make_views(config: GenerateConfig, index: int) -> dict[str, np.ndarray]:
    """Arrays of one shard's rows (views, ...) for one scene."""
    scene, rng = make_scene(config.seed, index)
    truth = scene.height_map()
    grasps = antipodal_grasps(truth)
    above = truth.height - truth.support
    thickness = float(above[truth.label > 0].max(initial=0.0))
    data = scene.data()
    camera = WristCamera(scene.model, config.camera, crop=CROP)
    rows: dict[str, list[np.ndarray]] = {}
    try:
        for _ in range(config.views):
            T = camera_pose(truth, rng)
            noisy = crop_resize(camera.render(data, T, rng))
            labels = view_labels(grasps, crop_resize(camera.render(data, T)))
            meta = (
                T[2, 3], index, thickness, len(scene.objects), thickness < THIN,
                scene.config.cloth_unevenness, labels.quality.max() * QUALITY_UNIT,
            )  # fmt: skip
            row = dict(vars(labels), depth=encode_depth(noisy.depth), meta=np.array(meta, np.float32))
            for name, value in row.items():
                rows.setdefault(name, []).append(value)
    finally:
        camera.close()
    return {name: np.stack(values) for name, values in rows.items()}


def camera_pose(truth: HeightMap, rng: np.random.Generator) -> FloatArray:
    """`T_world_camera` (4, 4): anywhere between z_min and z_max, mostly with an object in view, any yaw."""
    height = rng.uniform(*CAMERA_HEIGHT)
    half_view = height * CROP / 2 / 385.0
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


def _prepare(config: GenerateConfig, out: Path) -> None:
    """Make the directory and describe the data set in `meta.json`, or check that it is the same one."""
    description = {
        "format": FORMAT,
        "seed": config.seed,
        "views": config.views,
        "camera": config.camera,
        "shard_scenes": SHARD_SCENES,
        "size": NETWORK_SIZE,
        "crop": CROP,
        "depth_unit_m": DEPTH_UNIT,
        "quality_unit": QUALITY_UNIT,
        "angle_unit_rad": ANGLE_UNIT,
        "angle_zero_bin": 128,
        "meta_columns": list(META_COLUMNS),
    }
    path = out / "meta.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if path.is_file():
            there = json.loads(path.read_text(encoding="utf-8"))
            if there != description:
                raise ConfigError(
                    "the directory holds other data", got=str(out), allowed="an empty directory"
                )
            return
        path.write_text(json.dumps(description, indent=2) + "\n", encoding="utf-8")
    except (OSError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise OutputError("cannot write training data", got=str(out), allowed=str(error)) from None


def _shard_path(out: Path, first_scene: int) -> Path:
    return out / f"shard_{first_scene // SHARD_SCENES:05d}.npz"


def _one_thread() -> None:
    cv2.setNumThreads(1)  # the workers fill the cores


def _write_shard(job: tuple[GenerateConfig, range, Path]) -> None:
    config, indices, path = job
    scenes = [make_views(config, index) for index in indices]
    arrays = {name: np.concatenate([scene[name] for scene in scenes]) for name in scenes[0]}
    partial = path.with_suffix(".part")
    try:
        _save(partial, arrays)
        partial.replace(path)
    except OSError as error:
        raise OutputError("cannot write a shard", got=str(path), allowed=str(error)) from None


def _save(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """An npz file, packed fast, whose bytes depend on the arrays alone."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in sorted(arrays.items()):
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, buffer.getvalue(), compresslevel=1)
