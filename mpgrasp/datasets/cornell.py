"""The Cornell grasping dataset (Jiang, Moseson and Saxena, ICRA 2011): folders 01 to 10 of pcdNNNN files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from mpgrasp.datasets.depth_files import read_depth, read_point_cloud, read_rgb
from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.datasets.reader import BrokenImageError
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.regular import read_regular
from mpgrasp.geometry import FloatArray, wrap_half_pi
from mpgrasp.grasp import GraspRectangle

_FILES = re.compile(r"pcd(\d{4})(cpos\.txt|r\.png|d\.tiff)")
FOCAL = 525.0
"""Nominal focal length of the Kinect that took it [px]."""
_TABLE = "z.txt"
"""Cornell's own list of images: number, number of the object, and more."""


class Cornell:
    """A copy of the dataset, or a part of it.

    Depth is read from pcdNNNNd.tiff where that is there (as the published GG-CNN code makes it), else from
    the point cloud pcdNNNN.txt. Objects are those of `z.txt` where that is there, else the images themselves.

    Raises:
        ConfigError: no image is there.
    """

    title = "Cornell"

    def __init__(self, folder: Path) -> None:
        found = {
            match[1]: path.parent
            for path in sorted(folder.rglob("pcd*"))
            if (match := _FILES.fullmatch(path.name))
        }
        if not found:
            raise ConfigError(
                "no Cornell dataset", got=str(folder), allowed="a folder with pcdNNNNcpos.txt in it or below"
            )
        self._folders = found
        self._objects = _objects(folder)

    @property
    def names(self) -> list[str]:
        """Numbers of the images, as texts of four digits."""
        return list(self._folders)

    def object_of(self, name: str) -> str:
        return self._objects.get(int(name), name)

    def read(self, name: str) -> LabelledImage:
        folder = self._folders[name]
        rectangles = read_rectangles(folder / f"pcd{name}cpos.txt")
        tiff, cloud = folder / f"pcd{name}d.tiff", folder / f"pcd{name}.txt"
        if tiff.is_file() or not cloud.is_file():
            depth, unit = read_depth(tiff)
        else:
            depth, unit = read_point_cloud(cloud), "mm"
        return LabelledImage(
            name=name,
            object=self.object_of(name),
            depth=depth,
            rgb=read_rgb(folder / f"pcd{name}r.png"),
            rectangles=rectangles,
            focal_px=FOCAL,
            unit=unit,
        )


def read_rectangles(path: Path) -> tuple[GraspRectangle, ...]:
    """Return the rectangles of a file of corners, four lines `x y` each, without those that have a NaN.

    The first edge runs along the opening, as in the published GG-CNN code.

    Raises:
        BrokenImageError: no such file, or no rectangle in it.
    """
    try:
        lines = read_regular(path, 1.0).decode("ascii", errors="replace").split("\n")
    except OSError as error:
        raise BrokenImageError(f"{path.name}: {error.strerror}") from error
    try:
        corners = np.array([line.split() for line in lines if line.strip()], float).reshape(-1, 2)
    except ValueError as error:
        raise BrokenImageError(f"{path.name}: no corners x y ({error})") from error
    whole = corners[: len(corners) // 4 * 4].reshape(-1, 4, 2)
    found = tuple(from_corners(box) for box in whole if np.isfinite(box).all())
    found = tuple(box for box in found if min(box.width_px, box.jaw_px) > 0)
    if not found:
        raise BrokenImageError(f"{path.name}: no rectangle")
    return found


def from_corners(corners: FloatArray) -> GraspRectangle:
    """Return the rectangle of corners (4, 2) as (u, v) [px]; the first edge runs along the opening."""
    (u, v), (along_u, along_v) = corners.mean(axis=0), corners[1] - corners[0]
    across = corners[2] - corners[1]
    return GraspRectangle(
        u=float(u),
        v=float(v),
        angle=float(wrap_half_pi(np.arctan2(-along_v, along_u))),
        width_px=float(np.hypot(along_u, along_v)),
        jaw_px=float(np.hypot(*across)),
    )


def _objects(folder: Path) -> dict[int, str]:
    """Object of each image by its number, from Cornell's own list; empty where that is missing."""
    for path in sorted(folder.rglob(_TABLE))[:1]:
        try:
            rows = [line.split() for line in read_regular(path, 10.0).decode("ascii", "replace").splitlines()]
        except OSError:
            return {}
        return {int(row[0]): row[1] for row in rows if len(row) > 1 and row[0].isdigit()}
    return {}
