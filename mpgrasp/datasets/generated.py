"""Training data of this project as a dataset: its dense labels as rectangles, so that the metric is the same.

A rectangle stands at every `STEP`-th pixel whose label has at least `GOOD` of the image's best quality.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.datasets.reader import BrokenImageError
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import GraspRectangle
from mpgrasp.training.data.labels import decode_angle, decode_depth
from mpgrasp.training.data.shard_reader import read_description, read_shard
from mpgrasp.training.data.views import stored_intrinsics
from mpgrasp.training.metrics import GOOD, JAW_SHARE

STEP = 3
"""Distance of the pixels along rows and columns that are made into rectangles [px]."""
_SCENE = "scene"


class Generated:
    """Shards that `python -m mpgrasp.training generate` has written. An object is a whole scene.

    Raises:
        ConfigError: no shard is there, or one of another format.
    """

    title = "generated"

    def __init__(self, folder: Path) -> None:
        shards = sorted(folder.glob("shard_*.npz"))
        if not shards:
            raise ConfigError("no shards", got=str(folder), allowed="a folder with shard_*.npz")
        told = read_description(folder)
        self._columns: list[str] = told["meta_columns"]
        self._places: dict[str, tuple[Path, int]] = {}
        self._scenes: dict[str, str] = {}
        for path in shards:
            with np.load(path) as file:
                meta = file["meta"]
            for row, values in enumerate(meta):
                name = f"{path.stem.removeprefix('shard_')}-{row:04d}"
                self._places[name] = path, row
                scene = values[self._columns.index(_SCENE)] if _SCENE in self._columns else row
                self._scenes[name] = f"scene {int(scene)}"
        self._open: tuple[Path, Mapping[str, Any]] | None = None

    @property
    def names(self) -> list[str]:
        """Number of the shard and of the row in it."""
        return list(self._places)

    def object_of(self, name: str) -> str:
        return self._scenes[name]

    def read(self, name: str) -> LabelledImage:
        path, row = self._places[name]
        arrays = self._arrays(path)
        rgb = arrays["rgb"][row] if "rgb" in arrays else None
        labels = rectangles_of(*(arrays[key][row] for key in ("quality", "angle", "width")))
        if not labels:
            raise BrokenImageError("no grasp is labelled")
        return LabelledImage(
            name=name,
            object=self._scenes[name],
            depth=decode_depth(arrays["depth"][row]),
            rgb=rgb,
            rectangles=labels,
            focal_px=stored_intrinsics().fx,
        )

    def _arrays(self, path: Path) -> Mapping[str, Any]:
        if self._open is None or self._open[0] != path:
            with np.load(path) as file:
                colour = "rgb" in file
            self._open = path, read_shard(path, colour=colour)
        return self._open[1]


def rectangles_of(quality: np.ndarray, angle: np.ndarray, width: np.ndarray) -> tuple[GraspRectangle, ...]:
    """Return the rectangles of dense labels (H, W) as they are stored, which see `training.data.labels`."""
    best = int(quality.max())
    if not best:
        return ()
    good = quality >= GOOD * best
    rows, cols = (axis * STEP for axis in np.nonzero(good[::STEP, ::STEP]))
    angles = decode_angle(angle)
    return tuple(
        GraspRectangle(
            u=float(col),
            v=float(row),
            angle=float(angles[row, col]),
            width_px=float(width[row, col]),
            jaw_px=JAW_SHARE * float(width[row, col]),
        )
        for row, col in zip(rows.tolist(), cols.tolist(), strict=True)
        if width[row, col] > 0
    )
