"""The multi-object, multi-grasp dataset (Chu, Xu and Vela, RA-L 2018), annotated as Cornell is.

`rgb_NNNN.*` and `depth_NNNN.*` are images, `rgb_NNNN_annotations.txt` holds four corners `x y` for each
rectangle; they may lie in any folders below one (https://github.com/ivalab/grasp_multiObject).
"""

from __future__ import annotations

import re
from pathlib import Path

from mpgrasp.datasets.cornell import FOCAL, read_rectangles
from mpgrasp.datasets.depth_files import read_depth, read_rgb
from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.datasets.reader import BrokenImageError
from mpgrasp.exceptions import ConfigError

_LABELS = re.compile(r"rgb_(\d{4})_annotations\.txt")
_IMAGE = re.compile(r"(rgb|depth)_(\d{4})\.(png|jpe?g|tiff?)", re.IGNORECASE)


class MultiObject:
    """A copy of the dataset, or a part of it. Each image counts as an object of its own.

    Raises:
        ConfigError: no image is there.
    """

    title = "multi-object"

    def __init__(self, folder: Path) -> None:
        self._labels: dict[str, Path] = {}
        self._images: dict[tuple[str, str], Path] = {}
        for path in sorted(folder.rglob("*_*")):
            if found := _LABELS.fullmatch(path.name):
                self._labels[found[1]] = path
            elif found := _IMAGE.fullmatch(path.name):
                self._images[found[1].lower(), found[2]] = path
        if not self._labels:
            raise ConfigError(
                "no multi-object dataset",
                got=str(folder),
                allowed="a folder with rgb_NNNN_annotations.txt in it or below",
            )

    @property
    def names(self) -> list[str]:
        """Numbers of the images, as texts of four digits."""
        return sorted(self._labels)

    def object_of(self, name: str) -> str:
        return name

    def read(self, name: str) -> LabelledImage:
        paths = [self._images.get((kind, name)) for kind in ("depth", "rgb")]
        if paths[0] is None or paths[1] is None:
            missing = "depth" if paths[0] is None else "rgb"
            raise BrokenImageError(f"no {missing}_{name} image")
        depth, unit = read_depth(paths[0])
        return LabelledImage(
            name=name,
            object=name,
            depth=depth,
            rgb=read_rgb(paths[1]),
            rectangles=read_rectangles(self._labels[name]),
            focal_px=FOCAL,
            unit=unit,
        )
