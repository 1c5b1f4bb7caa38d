"""Training shards in memory, and augmented batches from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.exceptions import ConfigError
from mpgrasp.training.augmentation import Augmentation, Sample, augment
from mpgrasp.training.data.labels import QUALITY_UNIT, decode_angle, decode_depth
from mpgrasp.training.data.shard_reader import read_description, read_shard

SCENE_COLUMN = "scene"
"""Images of one scene are either all held out or none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Network inputs and the samples' labels, stacked."""

    image: NDArray[np.float32]
    """(n, channels, H, W)"""
    quality: NDArray[np.float32]
    """(n, H, W)"""
    angle: NDArray[np.float32]
    """(n, H, W)"""
    width: NDArray[np.float32]
    """(n, H, W) [px]"""
    valid: NDArray[np.bool_]
    """(n, H, W)"""


class GraspDataset:
    """Shards of one or several directories.

    Args:
        directories: where shards lie; all must have the same columns.
        holdout: share of scenes for validation.
        colour: read colour too.
        images: train on the first so many images, after held-out ones are put aside; None takes all.

    Raises:
        ConfigError: no shards, shards that cannot be read, or colour is asked for and not there.
    """

    def __init__(
        self,
        directories: Sequence[Path],
        *,
        holdout: float = 0.1,
        colour: bool = False,
        images: int | None = None,
    ) -> None:
        if not 0 <= holdout < 1:
            raise ConfigError("unusable share of held-out scenes", got=holdout, allowed="from 0 to below 1")
        self._directories = [Path(d) for d in directories]
        self._holdout, self._images = holdout, images
        self.colour = colour
        self._paths: list[Path] = []
        self._told: dict[Path, dict[str, Any]] = {}
        self._shards: list[dict[str, np.ndarray]] = []
        self.columns: list[str] = []
        self.meta = np.zeros((0, 0), np.float32)
        self.training = self.held = np.zeros(0, np.intp)
        self._place = np.zeros((0, 2), np.intp)  # image -> (shard, row)
        self.refresh()
        if not len(self.training):
            raise ConfigError(
                "no training images",
                got=[str(d) for d in directories],
                allowed="directories with shard_*.npz",
            )

    def refresh(self) -> int:
        """Read shards that have appeared since, and return how many; earlier images keep their numbers."""
        found = [p for d in self._directories for p in sorted(d.glob("shard_*.npz")) if p not in self._paths]
        for path in found:
            self._told[path.parent] = told = read_description(path.parent)
            shard = read_shard(path, colour=self.colour)
            columns = told["meta_columns"]
            if len(columns) != shard["meta"].shape[1]:
                raise ConfigError(
                    "shard and its description disagree", got=str(path), allowed=f"columns {columns}"
                )
            if self._shards and columns != self.columns:
                raise ConfigError("shards with different columns", got=columns, allowed=str(self.columns))
            self.columns = columns
            self._paths.append(path)
            rows = np.arange(len(shard["depth"]))
            place = np.column_stack([np.full(len(rows), len(self._shards)), rows])
            self._place = np.concatenate([self._place, place])
            self.meta = np.concatenate([self.meta, shard["meta"]]) if self._shards else shard["meta"]
            self._shards.append(shard)
        if found:
            held = _held_out(self._scenes(), self._holdout)
            self.training, self.held = np.flatnonzero(~held)[: self._images], np.flatnonzero(held)
        return len(found)

    def __len__(self) -> int:
        return len(self._place)

    def column(self, name: str) -> NDArray[np.float32] | None:
        """Return values (n,) of a meta column, or None where shards have no such column."""
        return self.meta[:, self.columns.index(name)] if name in self.columns else None

    def _scenes(self) -> NDArray[np.int64]:
        scenes = self.column(SCENE_COLUMN)
        return (self._place[:, 0] if scenes is None else np.rint(scenes)).astype(np.int64)

    @property
    def scene_count(self) -> int:
        """Number of scenes that the training images show."""
        return len(np.unique(self._scenes()[self.training]))

    def description(self) -> list[dict[str, object]]:
        """Return each directory's name, number of shards, facts from its meta.json, and lifts."""
        about: list[dict[str, object]] = []
        for directory, meta in self._told.items():
            shards = sum(path.parent == directory for path in self._paths)
            making: dict[str, object] = {
                k: meta[k] for k in ("format", "seed", "views", "shard_scenes", "camera") if k in meta
            }
            about.append({"name": directory.name, "shards": shards, **making, **self._lifts(directory)})
        return about

    def _lifts(self, directory: Path) -> dict[str, object]:
        """Return counts (lifted, tried) of the simulated lifts behind the labels, by source of the grasps."""
        names = self._told[directory].get("trial_columns")
        read = zip(self._paths, self._shards, strict=True)
        trials = [s["trials"] for path, s in read if path.parent == directory and "trials" in s]
        if not names or not trials:
            return {}
        told = dict(zip(names, np.concatenate(trials).T, strict=True))
        positive, audit = told["positive"] > 0, told["audit"] > 0
        groups = {
            "analytic_positives": positive & ~audit,
            "analytic_negatives": ~positive,
            "shipped_positives": audit,
        }
        return {"lifts": {k: [int(told["lifted"][m].sum()), int(m.sum())] for k, m in groups.items()}}

    def scene(self, index: int) -> tuple[int, int]:
        """Return seed and number of the scene that image `index` shows, as `make_scene` takes them.

        Raises:
            ConfigError: shards that do not tell.
        """
        scenes = self.column(SCENE_COLUMN)
        directory = self._paths[self._place[index, 0]].parent
        if scenes is None or "seed" not in self._told[directory]:
            raise ConfigError("shards that do not tell their scenes", got=str(directory), allowed="a seed")
        return int(self._told[directory]["seed"]), int(scenes[index])

    def sample(self, index: int) -> Sample:
        """Return image `index` as it is."""
        shard, row = self._place[index]
        arrays = self._shards[shard]
        return Sample(
            depth=np.nan_to_num(decode_depth(arrays["depth"][row])),
            quality=arrays["quality"][row] * np.float32(QUALITY_UNIT),
            angle=decode_angle(arrays["angle"][row]),
            width=arrays["width"][row].astype(np.float32),
            valid=np.ones(arrays["depth"][row].shape, bool),
            rgb=arrays["rgb"][row] if self.colour else None,
        )

    def batch(
        self,
        indices: Sequence[int] | NDArray[np.intp],
        image: NetworkInput,
        rng: np.random.Generator | None = None,
        augmentation: Augmentation | None = None,
    ) -> Batch:
        """Return inputs and labels of those images, augmented where there is an rng."""
        samples = [self.sample(int(i)) for i in indices]
        if rng is not None:
            samples = [augment(s, augmentation or Augmentation(), rng) for s in samples]
        samples = [s.resized(image.size) for s in samples]
        return Batch(
            image=np.stack([image(s.depth, s.rgb) for s in samples]),
            quality=np.stack([s.quality for s in samples]),
            angle=np.stack([s.angle for s in samples]),
            width=np.stack([s.width for s in samples]),
            valid=np.stack([s.valid for s in samples]),
        )


def _held_out(scenes: NDArray[np.int64], share: float) -> NDArray[np.bool_]:
    """True for images to hold out: a hash of the scene decides, so that it stays when more shards come."""
    hashed = (scenes.astype(np.uint64) * np.uint64(2654435761)) % np.uint64(2**32)
    return hashed / 2**32 < share
