"""A tiny training set in the shards' format: one bar on a tilted plane an image, graspable across its middle.

Bars lie along one of two directions, so that a small network learns them within seconds.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from mpgrasp.training.labels import encode_angle, encode_depth

DIRECTIONS = (0.4, -1.1)
"""Closing directions, an odd angle and the one at right angles to it, nearly [rad]."""
COLUMNS = ["camera_height", "scene", "thin"]


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
    return {
        "depth": encode_depth(depth),
        "quality": np.rint(255 * quality).astype(np.uint8),
        "angle": encode_angle(np.where(bar, closing, 0.0)),
        "width": np.where(bar, np.rint(breadth * 1.5), 0).astype(np.uint8),
        "object_mask": bar.astype(np.uint8),
        "meta": np.array([0.4, 0.0, float(height < 0.013)], np.float32),
    }


def write_shards(
    directory: Path, *, shards: int = 2, images: int = 24, seed: int = 0, size: int = 64
) -> Path:
    """Shards of `images` images, each of its own scene."""
    rng = np.random.default_rng(seed)
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "meta.json").write_text(json.dumps({"format": 1, "seed": seed, "meta_columns": COLUMNS}))
    for k in range(shards):
        rows = [toy_image(rng, size) for _ in range(images)]
        arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
        arrays["meta"][:, 1] = np.arange(images) + k * images
        np.savez(directory / f"shard_{k:05d}.npz", **arrays)  # type: ignore[arg-type]
    return directory
