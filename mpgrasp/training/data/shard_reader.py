"""Reading of shards for training, with checks of all that may be wrong in a file.

A shard is `shard_00000.npz` as `generate` writes it: `depth`, `quality`, `angle` and `width`, each
(n, 224, 224) in the units of labels.py, `rgb` (n, 224, 224, 3), and `meta` (n, k), whose columns are the
"meta_columns" of meta.json beside it.

Holes are filled once, when a shard is read, by the function that the detectors use. Depth stays in its 16
bit units: half-precision floats would round to 0.25 mm, which is much for a stick of 4 mm.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from mpgrasp.depth import inpaint
from mpgrasp.exceptions import ConfigError
from mpgrasp.training.data.labels import decode_depth, encode_depth
from mpgrasp.training.data.shards import FORMAT


def read_description(directory: Path) -> dict[str, Any]:
    """Return what meta.json tells of the shards beside it; its "meta_columns" are words.

    Raises:
        ConfigError: it is unreadable or of another format.
    """
    path = directory / "meta.json"
    try:
        told = dict(json.loads(path.read_text(encoding="utf-8")))
        if told.get("format") != FORMAT:
            raise ConfigError(
                f"shards of another format in {directory.name}",
                got=told.get("format", "none"),
                allowed=f"{FORMAT}; generate them anew",
            )
        return told | {"meta_columns": [str(name) for name in told["meta_columns"]]}
    except ConfigError:
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"unreadable description of shards: {error!r}", got=str(path)) from error


def read_shard(path: Path, *, colour: bool) -> dict[str, np.ndarray]:
    """Return the arrays of a shard, with the holes of its depth filled; colour only on request.

    Raises:
        ConfigError: it is unreadable or of another format, or has no colour.
    """
    keys = ["depth", "quality", "angle", "width", "meta", *(["rgb"] if colour else [])]
    try:
        with np.load(path) as file:
            if colour and "rgb" not in file:
                raise ConfigError(
                    "shard without colour", got=str(path), allowed="input d, or data with colour"
                )
            shard = {key: file[key] for key in (*keys, "trials") if key in keys or key in file}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ConfigError(f"unreadable shard: {error}", got=str(path)) from error
    shape = shard["depth"].shape
    if len(shape) != 3 or any(shard[k].shape != shape for k in ("quality", "angle", "width")):
        raise ConfigError("shard with maps of different sizes", got=str(path), allowed="all (n, H, W)")
    if colour and (shard["rgb"].shape != (*shape, 3) or shard["rgb"].dtype != np.uint8):
        raise ConfigError("shard with unusable colour", got=str(path), allowed="uint8 (n, H, W, 3)")
    if shard["depth"].dtype != np.uint16 or len(shard["meta"]) != shape[0]:
        raise ConfigError(
            "shard of another format", got=str(path), allowed="uint16 depth, one meta row an image"
        )
    holes = np.flatnonzero((shard["depth"] == 0).any(axis=(1, 2)))
    for k in holes:
        shard["depth"][k] = encode_depth(inpaint(decode_depth(shard["depth"][k])))
    return shard
