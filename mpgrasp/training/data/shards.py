"""Shards on disk: what they hold, `meta.json` that says so, and files that appear whole or not at all."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from pathlib import Path

import numpy as np

from mpgrasp.depth import CROP, NETWORK_SIZE
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.files.json_values import difference
from mpgrasp.training.data.generate_config import GenerateConfig
from mpgrasp.training.data.labels import ANGLE_UNIT, DEPTH_UNIT, QUALITY_UNIT
from mpgrasp.training.data.verification import GOOD, LIFT_OUTCOMES, TRIAL_COLUMNS
from mpgrasp.training.data.views import META_COLUMNS

FORMAT = 4
"""Format of shards and `meta.json`, and of the objects of a seed's scenes.

When a seed comes to mean other objects, count up: data on disk would be lifted in scenes that its images do
not show. An object that joins the catalogue or a shipped suite is enough, for training keeps away from it."""
SHARD_SCENES = 20
"""Scenes in a shard."""


def describe(config: GenerateConfig) -> dict[str, object]:
    """Return the content of `meta.json`."""
    return {
        "format": FORMAT,
        "seed": config.seed,
        "views": config.views,
        "camera": config.camera,
        "colour": config.colour,
        "shard_scenes": SHARD_SCENES,
        "size": NETWORK_SIZE,
        "crop": CROP,
        "depth_unit_m": DEPTH_UNIT,
        "quality_unit": QUALITY_UNIT,
        "angle_unit_rad": ANGLE_UNIT,
        "angle_zero_bin": 128,
        "good_quality": GOOD,
        "meta_columns": list(META_COLUMNS),
        "trial_columns": list(TRIAL_COLUMNS),
        "lift_outcomes": list(LIFT_OUTCOMES),
    }


def prepare(config: GenerateConfig, out: Path) -> None:
    """Make the directory and describe the data set in `meta.json`, or check that it is the same one.

    Raises:
        ConfigError: the directory holds data of another configuration.
        OutputError: it cannot be written.
    """
    path = out / "meta.json"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if path.is_file():
            other = difference(json.loads(path.read_text(encoding="utf-8")), describe(config))
            if other:
                raise ConfigError(
                    f"the directory holds other data ({other.words('there', 'here')})",
                    got=str(out),
                    allowed="an empty directory",
                )
            return
        replace_file(path, json.dumps(describe(config), indent=2) + "\n")
    except ConfigError:
        raise
    except (OSError, ValueError) as error:
        raise OutputError("cannot write training data", got=str(out), allowed=str(error)) from None


def shard_path(out: Path, first_scene: int) -> Path:
    """Return the path of the shard that begins with that scene."""
    return out / f"shard_{first_scene // SHARD_SCENES:05d}.npz"


def planned(config: GenerateConfig, out: Path) -> dict[Path, range]:
    """Return the paths of all shards of the set, and the scenes in each."""
    return {
        shard_path(out, first): range(first, min(first + SHARD_SCENES, config.scenes))
        for first in range(0, config.scenes, SHARD_SCENES)
    }


def unfinished(config: GenerateConfig, out: Path) -> dict[Path, range]:
    """Return planned shards that are not there with exactly their scenes; an unreadable one is not there.

    Raises:
        ConfigError: the directory holds scenes beyond the last, which training would read too.
    """
    plan = planned(config, out)
    there = {path: _scenes(path) for path in sorted(out.glob("shard_*.npz"))}
    beyond = [p for p, scenes in there.items() if p not in plan or max(scenes, default=0) >= config.scenes]
    if beyond:
        raise ConfigError(
            "the directory holds scenes beyond the last one",
            got=", ".join(path.name for path in beyond),
            allowed=f"more than {config.scenes} scenes, or another directory",
        )
    return {
        path: scenes
        for path, scenes in plan.items()
        if there.get(path) != np.repeat(scenes, config.views).tolist()
    }


def _scenes(path: Path) -> list[int]:
    """Return the scene that each row of a shard shows; none where it cannot be read."""
    try:
        with np.load(path) as arrays:
            scenes: list[int] = arrays["meta"][:, META_COLUMNS.index("scene")].astype(int).tolist()
            return scenes
    except (OSError, ValueError, LookupError, EOFError, zipfile.BadZipFile, zlib.error):
        return []


def write_shard(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write an npz file, packed fast, whose bytes depend on the arrays alone; at once, or not at all.

    Raises:
        OutputError: it cannot be written.
    """
    partial = path.with_suffix(".part")
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name, array in sorted(arrays.items()):
                buffer = io.BytesIO()
                np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
                entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, buffer.getvalue(), compresslevel=1)
        partial.replace(path)
    except OSError as error:
        raise OutputError("cannot write a shard", got=str(path), allowed=str(error)) from None
