"""Training shards in memory, and augmented batches from them.

A shard is `shard_00000.npz` with, for n images of 224x224:

    depth        uint16  0.05 mm units, 0 = no return
    quality      uint8   1/255
    angle        uint8   pi/256 from -pi/2, closing direction in the image (see grasp.py)
    width        uint8   opening [px]
    object_mask  uint8   0 support, 1 object
    meta         float32 (n, k), columns named by "columns" in meta.json beside the shards

Holes are filled once, when a shard is read, by the function that the detectors use. Depth stays in its 16 bit units:
half-precision floats would round to 0.25 mm, which is much for a stick of 4 mm.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import inpaint
from mpgrasp.detectors.network_input import NetworkInput
from mpgrasp.exceptions import ConfigError

DEPTH_UNIT = 5e-5
"""[m]"""
ANGLE_UNIT = np.pi / 256
"""[rad]"""
SCENE_COLUMN = "scene_seed"
"""Images of one scene are either all held out or none."""


@dataclass(frozen=True, kw_only=True)
class Augmentation:
    """Random changes to training images, with the labels changed to match."""

    rotation: float = np.pi / 4
    """Largest turn beside flips and quarter turns [rad]."""
    zoom: tuple[float, float] = (0.85, 1.25)
    """Magnification: the camera comes nearer or goes farther, heights stay as they are."""
    warp_probability: float = 0.5
    """Share of images that are turned and zoomed at all; flips and quarter turns are free of loss."""
    offset: float = 0.01
    """Largest shift of all depths [m]."""

    def __post_init__(self) -> None:
        if not 0 < self.zoom[0] <= self.zoom[1] or not 0 <= self.warp_probability <= 1:
            raise ConfigError("unusable augmentation", got=self, allowed="0 < zoom, probability in [0, 1]")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """One image with dense labels, all (H, W)."""

    depth: NDArray[np.float32]
    """[m], holes filled."""
    quality: NDArray[np.float32]
    """[0, 1]"""
    angle: NDArray[np.float32]
    """[rad]"""
    width: NDArray[np.float32]
    """[px]"""
    valid: NDArray[np.bool_]
    """False where a turned image has no data."""


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

    Raises:
        ConfigError: no shards, or shards that cannot be read.
    """

    def __init__(self, directories: Sequence[Path], *, holdout: float = 0.1) -> None:
        if not 0 <= holdout < 1:
            raise ConfigError("unusable share of held-out scenes", got=holdout, allowed="from 0 to below 1")
        self._directories = [Path(d) for d in directories]
        self._holdout = holdout
        self._seen: set[Path] = set()
        self._shards: list[dict[str, np.ndarray]] = []
        self.columns: list[str] = []
        self.meta = np.zeros((0, 0), np.float32)
        self.training = self.validation = np.zeros(0, np.intp)
        self._place = np.zeros((0, 2), np.intp)  # image -> (shard, row)
        self.refresh()
        if not len(self.training):
            raise ConfigError(
                "no training images", got=[str(d) for d in directories], allowed="directories with shard_*.npz"
            )

    def refresh(self) -> int:
        """Read shards that have appeared since, and return how many; earlier images keep their numbers."""
        found = [p for d in self._directories for p in sorted(d.glob("shard_*.npz")) if p not in self._seen]
        for path in found:
            shard = _read_shard(path)
            columns = _read_columns(path.parent, shard["meta"].shape[1])
            if self._shards and columns != self.columns:
                raise ConfigError("shards with different columns", got=columns, allowed=str(self.columns))
            self.columns = columns
            self._seen.add(path)
            rows = np.arange(len(shard["depth"]))
            place = np.column_stack([np.full(len(rows), len(self._shards)), rows])
            self._place = np.concatenate([self._place, place])
            self.meta = np.concatenate([self.meta, shard["meta"]]) if self._shards else shard["meta"]
            self._shards.append(shard)
        if found:
            held = _held_out(self._scenes(), self._holdout)
            self.training, self.validation = np.flatnonzero(~held), np.flatnonzero(held)
        return len(found)

    def __len__(self) -> int:
        return len(self._place)

    def column(self, name: str) -> NDArray[np.float32] | None:
        """(n,) values of a meta column, or None where shards have no such column."""
        return self.meta[:, self.columns.index(name)] if name in self.columns else None

    def _scenes(self) -> NDArray[np.int64]:
        scenes = self.column(SCENE_COLUMN)
        return (self._place[:, 0] if scenes is None else np.rint(scenes)).astype(np.int64)

    @property
    def scene_count(self) -> int:
        """How many scenes the training images show."""
        return len(np.unique(self._scenes()[self.training]))

    def sample(self, index: int) -> Sample:
        """Image `index` as it is."""
        shard, row = self._place[index]
        arrays = self._shards[shard]
        return Sample(
            depth=arrays["depth"][row].astype(np.float32) * np.float32(DEPTH_UNIT),
            quality=arrays["quality"][row].astype(np.float32) / 255,
            angle=(arrays["angle"][row] * ANGLE_UNIT - np.pi / 2).astype(np.float32),
            width=arrays["width"][row].astype(np.float32),
            valid=np.ones(arrays["depth"][row].shape, bool),
        )

    def batch(
        self,
        indices: Sequence[int] | NDArray[np.intp],
        image: NetworkInput,
        rng: np.random.Generator | None = None,
        augmentation: Augmentation | None = None,
    ) -> Batch:
        """Inputs and labels of those images, augmented where there is an rng."""
        samples = [self.sample(int(i)) for i in indices]
        if rng is not None:
            samples = [augment(s, augmentation or Augmentation(), rng) for s in samples]
        return Batch(
            image=np.stack([image(s.depth) for s in samples]),
            quality=np.stack([s.quality for s in samples]),
            angle=np.stack([s.angle for s in samples]),
            width=np.stack([s.width for s in samples]),
            valid=np.stack([s.valid for s in samples]),
        )


def augment(sample: Sample, config: Augmentation, rng: np.random.Generator) -> Sample:
    """The sample flipped, turned, zoomed and moved in depth at random; angles and widths go along."""
    flip, quarters = bool(rng.integers(2)), int(rng.integers(4))
    depth, quality, angle = sample.depth, sample.quality, sample.angle
    width, valid = sample.width, sample.valid
    maps = [depth, quality, angle, width, valid]
    if flip:
        maps = [m[:, ::-1] for m in maps]
        maps[2] = -maps[2]
    # both np.rot90 and image angles are counter-clockwise on screen
    depth, quality, angle, width, valid = (np.rot90(m, quarters) for m in maps)
    turned = Sample(
        depth=depth + np.float32(rng.uniform(-config.offset, config.offset)),
        quality=quality,
        angle=angle + np.float32(quarters * np.pi / 2),
        width=width,
        valid=valid,
    )
    turn = rng.uniform(-config.rotation, config.rotation)
    zoom = float(np.exp(rng.uniform(*np.log(config.zoom))))
    return warp(turned, turn, zoom) if rng.uniform() < config.warp_probability else turned


def warp(sample: Sample, turn: float, zoom: float) -> Sample:
    """The sample turned by `turn` [rad], counter-clockwise on screen, and magnified by `zoom`, about its centre."""
    rows, cols = sample.depth.shape
    matrix = cv2.getRotationMatrix2D(((cols - 1) / 2, (rows - 1) / 2), np.rad2deg(turn), zoom)
    # nearest pixels: anything else would mix depths across edges and angles across the wrap
    stacked = np.dstack([sample.depth, sample.quality, sample.angle, sample.width])
    moved = cv2.warpAffine(stacked, matrix, (cols, rows), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REFLECT)
    valid = cv2.warpAffine(sample.valid.astype(np.uint8), matrix, (cols, rows), flags=cv2.INTER_NEAREST)
    depth, quality, angle, width = np.moveaxis(moved, -1, 0)
    middle = np.float32(np.median(sample.depth[::4, ::4]))
    return Sample(
        # a nearer camera sees the scene larger and every height as it was
        depth=depth + middle * np.float32(1 / zoom - 1),
        quality=quality,
        angle=angle + np.float32(turn),
        width=width * np.float32(zoom),
        valid=valid > 0,
    )


def _held_out(scenes: NDArray[np.int64], share: float) -> NDArray[np.bool_]:
    """Which images to hold out: a hash of the scene decides, so that it stays when more shards come."""
    hashed = (scenes.astype(np.uint64) * np.uint64(2654435761)) % np.uint64(2**32)
    return hashed / 2**32 < share


def _read_columns(directory: Path, count: int) -> list[str]:
    path = directory / "meta.json"
    try:
        columns = json.loads(path.read_text())["columns"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"unreadable description of shards: {error!r}", got=str(path)) from error
    if not isinstance(columns, list) or len(columns) != count:
        raise ConfigError("shards and their description disagree", got=columns, allowed=f"{count} columns")
    return [str(c) for c in columns]


def _read_shard(path: Path) -> dict[str, np.ndarray]:
    try:
        with np.load(path) as file:
            shard = {key: file[key] for key in ("depth", "quality", "angle", "width", "meta")}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ConfigError(f"unreadable shard: {error}", got=str(path)) from error
    shape = shard["depth"].shape
    if len(shape) != 3 or any(shard[k].shape != shape for k in ("quality", "angle", "width")):
        raise ConfigError("shard with maps of different sizes", got=str(path), allowed="all (n, H, W)")
    if shard["depth"].dtype != np.uint16 or len(shard["meta"]) != shape[0]:
        raise ConfigError("shard of another format", got=str(path), allowed="uint16 depth, one meta row an image")
    holes = np.flatnonzero((shard["depth"] == 0).any(axis=(1, 2)))
    for k in holes:
        metres = shard["depth"][k].astype(np.float32) * np.float32(DEPTH_UNIT)
        filled = inpaint(np.where(metres > 0, metres, np.nan).astype(np.float32))
        shard["depth"][k] = np.rint(np.nan_to_num(filled) / DEPTH_UNIT).astype(np.uint16)
    return shard
