"""A folder of one's own depth images, with colour and labels beside them where there are some.

NAME.tiff, NAME.png or NAME.npy is a depth image, in metres or millimetres. NAME_RGB.png is its colour image,
and NAME_grasps.txt holds its labels as Jacquard's do, `x;y;theta;opening;jaw` a line. Both may be missing:
what has no label is looked at, and counts for no rate.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mpgrasp.datasets.depth_files import read_depth, read_depth_array, read_rgb
from mpgrasp.datasets.jacquard import read_grasps
from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.exceptions import ConfigError

FOCAL_SHARE = 0.95
"""Focal length over the width of the image where nobody says it: that of a D435's depth images."""
_ENDINGS = (".tiff", ".tif", ".png", ".npy")
_RGB, _GRASPS = "_RGB.png", "_grasps.txt"


class DepthFolder:
    """Depth images of a folder, and of those below it.

    Args:
        folder: above the images.
        focal_px: focal length of the camera [px]; None for `FOCAL_SHARE` of the width.

    Raises:
        ConfigError: no image is there, or a focal length that is none.
    """

    title = "depth folder"

    def __init__(self, folder: Path, focal_px: float | None = None) -> None:
        if focal_px is not None and not (np.isfinite(focal_px) and focal_px > 0):
            raise ConfigError("unusable focal length", got=focal_px, allowed="above 0 [px]")
        self._focal = focal_px
        self._paths = {
            str(path.relative_to(folder).with_suffix("")): path
            for path in sorted(folder.rglob("*"))
            if path.suffix.lower() in _ENDINGS and not path.name.endswith(_RGB) and path.is_file()
        }
        if not self._paths:
            raise ConfigError(
                "no depth image", got=str(folder), allowed=f"a folder with {', '.join(_ENDINGS)} files"
            )

    @property
    def names(self) -> list[str]:
        """Paths of the images below the folder, without their endings."""
        return list(self._paths)

    def object_of(self, name: str) -> str:
        return name

    def read(self, name: str) -> LabelledImage:
        path = self._paths[name]
        depth, unit = read_depth_array(path) if path.suffix.lower() == ".npy" else read_depth(path)
        rgb, labels = (path.with_name(f"{path.stem}{ending}") for ending in (_RGB, _GRASPS))
        return LabelledImage(
            name=name,
            object=name,
            depth=depth,
            rgb=read_rgb(rgb) if rgb.is_file() else None,
            rectangles=read_grasps(labels) if labels.is_file() else (),
            focal_px=self._focal or FOCAL_SHARE * depth.shape[1],
            unit=unit,
        )
