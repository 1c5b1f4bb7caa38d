"""Folds of a dataset for cross-validation, by image or by object, as a function of their names alone.

Image-wise, images of one object may be in several folds; object-wise, all images of an object are in one, so
that what is tested was never seen in training (Jiang, Moseson and Saxena, ICRA 2011; Lenz, Lee and Saxena,
IJRR 2015). The order is that of the names' SHA-256 hashes: the same dataset has the same folds everywhere.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from typing import Literal, get_args

import numpy as np

from mpgrasp.exceptions import ConfigError

Split = Literal["iw", "ow"]
SPLITS: tuple[Split, ...] = get_args(Split)
"""Image-wise and object-wise."""
FOLDS = 5
"""Number of folds; the paper's."""


def assign(objects: Mapping[str, str], split: Split, count: int = FOLDS) -> dict[str, int]:
    """Return the fold of each image, from 0.

    Folds are as even as can be: image-wise they differ by one image at most; object-wise each object goes,
    the ones with most images first, to the fold that has least.

    Args:
        objects: name of the object by name of the image.
        split: by what is split.
        count: number of folds.

    Raises:
        ConfigError: an unknown split, or fewer images or objects than folds.
    """
    if split not in SPLITS:
        raise ConfigError("unknown split", got=split, allowed=SPLITS)
    groups: dict[str, list[str]] = {}
    for image, thing in objects.items():
        groups.setdefault(image if split == "iw" else thing, []).append(image)
    if not 2 <= count <= len(groups):
        what = "images" if split == "iw" else "objects"
        raise ConfigError(
            f"unusable number of folds of {len(groups)} {what}", got=count, allowed="2 to their number"
        )
    sizes = [0] * count
    fold: dict[str, int] = {}
    for name in sorted(groups, key=lambda name: (-len(groups[name]), _hash(name))):
        least = sizes.index(min(sizes))
        sizes[least] += len(groups[name])
        fold.update(dict.fromkeys(groups[name], least))
    return {image: fold[image] for image in objects}


def members(fold: Mapping[str, int], count: int) -> list[list[str]]:
    """Return the names of the images of each fold, in order."""
    return [sorted(image for image, k in fold.items() if k == which) for which in range(count)]


def spread(shares: Iterable[float]) -> tuple[float, float]:
    """Return mean and standard deviation over folds (with n - 1; 0 of a single one)."""
    values = np.array(list(shares), float)
    return float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else 0.0


def _hash(name: str) -> str:
    return hashlib.sha256(name.encode()).hexdigest()
