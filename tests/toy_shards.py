"""A tiny training set in the shards' format: one bar on a tilted plane an image, graspable across its middle.

Bars lie along one of two directions, so that a small network learns them within seconds.
"""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from mpgrasp.geometry import looking_down
from mpgrasp.training.data.labels import encode_angle, encode_depth
from mpgrasp.training.data.shards import FORMAT

DIRECTIONS = (0.4, -1.1)
"""Closing directions, an odd angle and the one at right angles to it, nearly [rad]."""
COLUMNS = ["camera_height", "scene", "thin", "camera_x", "camera_y", "turn_x", "turn_y", "turn_z"]
CAMERA = looking_down([0.5, 0.0, 0.4], 0.3)
"""Pose of every image's camera."""


def toy_image(rng: np.random.Generator, size: int = 64) -> dict[str, np.ndarray]:
    v, u = np.indices((size, size), dtype=float)
    cu, cv = rng.uniform(0.3 * size, 0.7 * size, 2)
    closing = rng.choice(DIRECTIONS) + rng.normal(0, 0.05)
    breadth, length = rng.uniform(6, 9), rng.uniform(20, 30)
    # (cos, -sin) is the closing direction in (u, v): across the bar
    across = (u - cu) * np.cos(closing) - (v - cv) * np.sin(closing)
    along = (u - cu) * np.sin(closing) + (v - cv) * np.cos(closing)
    bar = (np.abs(across) < breadth / 2) & (np.abs(along) < length / 2)
    height = rng.uniform(0.005, 0.03)
    depth = 0.4 + 1e-4 * (u - cu) - height * bar + rng.normal(0, 2e-4, u.shape)
    quality = np.where(bar, np.exp(-((across / breadth) ** 2) - (along / length) ** 2), 0.0)
    depth[rng.random(depth.shape) < 0.002] = np.nan
    turn = cv2.Rodrigues(CAMERA[:3, :3])[0][:, 0]
    return {
        "depth": encode_depth(depth),
        "quality": np.rint(255 * quality).astype(np.uint8),
        "angle": encode_angle(np.where(bar, closing, 0.0)),
        "width": np.where(bar, np.rint(breadth * 1.5), 0).astype(np.uint8),
        "object_mask": bar.astype(np.uint8),
        "rgb": toy_colour(bar, rng),
        "meta": np.array([0.4, 0.0, height < 0.013, *CAMERA[:2, 3], *turn], np.float32),
    }


def toy_colour(bar: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A bar of a random colour on grey cloth."""
    image = np.where(bar[..., None], rng.uniform(30, 220, 3), 120.0) + rng.normal(0, 4, (*bar.shape, 3))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def write_shards(
    directory: Path, *, shards: int = 2, images: int = 24, seed: int = 0, size: int = 64
) -> Path:
    """Shards of `images` images, each of its own scene."""
    rng = np.random.default_rng(seed)
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "meta.json").write_text(
        json.dumps({"format": FORMAT, "seed": seed, "meta_columns": COLUMNS})
    )
    for k in range(shards):
        rows = [toy_image(rng, size) for _ in range(images)]
        arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
        arrays["meta"][:, 1] = np.arange(images) + k * images
        np.savez(directory / f"shard_{k:05d}.npz", **arrays)  # type: ignore[arg-type]
    return directory
