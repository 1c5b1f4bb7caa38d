"""Images of a dataset as training shards, so that networks are trained on them as on generated data.

Labels are those of the published GG-CNN code: the middle third of each rectangle, along its opening, has
quality 1, the rectangle's angle and its opening; a later rectangle covers an earlier one.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.grasp import GraspRectangle
from mpgrasp.training.data.labels import encode_angle, encode_depth
from mpgrasp.training.data.shards import FORMAT, write_shard

IMAGES = 128
"""Images of a shard."""
CORE = 1 / 3
"""Share of a rectangle, along its opening, that is labelled."""


def write_training_shards(images: Iterable[LabelledImage], folder: Path, source: str) -> int:
    """Write square images with their labels as shards, and return their number.

    Args:
        images: squares of one size, all with colour or none.
        folder: for the shards and meta.json; made if need be.
        source: of the images, for the training card.

    Raises:
        ConfigError: an image that is no square, or some have colour and others do not.
        OutputError: the folder cannot be written.
    """
    remaining, count, coloured = iter(images), 0, set[bool]()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError("training shards cannot be written", got=str(folder), allowed=str(error)) from error
    for number, batch in enumerate(_batches(remaining)):
        coloured |= {image.rgb is not None for image in batch}
        if len(coloured) > 1:
            raise ConfigError("a dataset of which some images have colour", got=source, allowed="all or none")
        rows = [_row(image, count + k) for k, image in enumerate(batch)]
        count += len(rows)
        arrays = {name: np.stack([row[name] for row in rows]) for name in rows[0]}
        write_shard(folder / f"shard_{number:05d}.npz", arrays)
    told = {"format": FORMAT, "source": source, "meta_columns": ["scene"], "colour": coloured == {True}}
    try:
        replace_file(folder / "meta.json", json.dumps(told, indent=2) + "\n")  # last: they are whole with it
    except OSError as error:
        raise OutputError("training shards cannot be written", got=str(folder), allowed=str(error)) from error
    return count


def dense_labels(
    rectangles: Iterable[GraspRectangle], size: int
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]:
    """Return quality, angle and width (size, size) of rectangles, as shards hold them."""
    quality, width = np.zeros((2, size, size), np.uint8)
    angle = np.full((size, size), encode_angle(np.zeros(1))[0], np.uint8)
    for rectangle in rectangles:
        core = replace(rectangle, width_px=CORE * rectangle.width_px).corners()
        mask = np.zeros((size, size), np.uint8)
        cv2.fillConvexPoly(mask, np.rint(core).astype(np.int32), 1)
        inside = mask > 0
        quality[inside] = 255
        angle[inside] = encode_angle(np.array([rectangle.angle]))[0]
        width[inside] = int(np.clip(np.rint(rectangle.width_px), 0, 255))
    return quality, angle, width


def _row(image: LabelledImage, number: int) -> dict[str, np.ndarray]:
    size = image.depth.shape[0]
    if image.depth.shape != (size, size):
        raise ConfigError(f"{image.name}: no square", got=image.depth.shape, allowed="as wide as high")
    quality, angle, width = dense_labels(image.rectangles, size)
    row: dict[str, np.ndarray] = {
        "depth": encode_depth(image.depth),
        "quality": quality,
        "angle": angle,
        "width": width,
        "meta": np.array([number], np.float32),
    }
    return row if image.rgb is None else row | {"rgb": image.rgb}


def _batches(images: Iterator[LabelledImage]) -> Iterator[list[LabelledImage]]:
    while batch := list(islice(images, IMAGES)):
        yield batch
