"""The Jacquard dataset (Depierre, Dellandrea and Chen, IROS 2018): rendered objects with simulated grasps."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

import numpy as np

from mpgrasp.datasets.depth_files import read_depth, read_rgb
from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.datasets.reader import BrokenImageError
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.regular import read_regular
from mpgrasp.geometry import wrap_half_pi
from mpgrasp.grasp import GraspRectangle

DepthKind = Literal["stereo", "perfect"]
DEPTHS: tuple[DepthKind, ...] = get_args(DepthKind)
"""Depth images of Jacquard: of its own stereo matching, with holes, or as rendered."""

FOCAL_SHARE = 1.1
"""Focal length of its rendered images over their width; assumed, since it is not published."""
_GRASPS, _RGB = "_grasps.txt", "_RGB.png"


class Jacquard:
    """A copy of the dataset, or a part of it, in any folders below one.

    Args:
        folder: above the images.
        depth: which of its depth images is read.

    Raises:
        ConfigError: no image is there, or an unknown kind of depth.
    """

    title = "Jacquard"

    def __init__(self, folder: Path, depth: DepthKind = "stereo") -> None:
        if depth not in DEPTHS:
            raise ConfigError("unknown depth of Jacquard", got=depth, allowed=DEPTHS)
        self._depth = depth
        found = {
            path.name.removesuffix(ending): path.parent
            for ending in (_RGB, _GRASPS)
            for path in sorted(folder.rglob(f"*{ending}"))
        }
        self._folders = dict(sorted(found.items()))
        if not found:
            raise ConfigError(
                "no Jacquard dataset", got=str(folder), allowed="a folder with N_OBJECT_grasps.txt below"
            )

    @property
    def names(self) -> list[str]:
        """Names of the images, NUMBER_OBJECT."""
        return list(self._folders)

    def object_of(self, name: str) -> str:
        return name.partition("_")[2] or name

    def read(self, name: str) -> LabelledImage:
        folder = self._folders[name]
        rectangles = read_grasps(folder / f"{name}{_GRASPS}")
        depth, unit = read_depth(folder / f"{name}_{self._depth}_depth.tiff")
        return LabelledImage(
            name=name,
            object=self.object_of(name),
            depth=depth,
            rgb=read_rgb(folder / f"{name}{_RGB}"),
            rectangles=rectangles,
            focal_px=FOCAL_SHARE * depth.shape[1],
            unit=unit,
        )


def read_grasps(path: Path) -> tuple[GraspRectangle, ...]:
    """Return the rectangles of a file with a line `x;y;theta;opening;jaw` each: pixels, degrees clockwise.

    Lines with a number that is none, or a size that is not above 0, are left out.

    Raises:
        BrokenImageError: no such file, or no rectangle in it.
    """
    try:
        lines = read_regular(path, 50.0).decode("ascii", errors="replace").splitlines()
    except OSError as error:
        raise BrokenImageError(f"{path.name}: {error.strerror}") from error
    found = []
    for line in filter(str.strip, lines):
        try:
            u, v, theta, opening, jaw = map(float, line.split(";"))
        except ValueError as error:
            raise BrokenImageError(f"{path.name}: no x;y;theta;opening;jaw: {line[:40]!r}") from error
        if np.isfinite([u, v, theta]).all() and opening > 0 and jaw > 0 and np.isfinite(opening + jaw):
            angle = float(wrap_half_pi(-np.deg2rad(theta)))
            found.append(GraspRectangle(u=u, v=v, angle=angle, width_px=opening, jaw_px=jaw))
    if not found:
        raise BrokenImageError(f"{path.name}: no rectangle")
    return tuple(found)
