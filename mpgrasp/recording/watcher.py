"""The camera beside the table, which watches the robot for films and reports."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np

from mpgrasp.camera.ray_caster import cast_rays
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import FloatArray, look_at
from mpgrasp.recording.false_colour import Picture

VIEWPOINT = look_at([1.40, -0.95, 0.85], [0.38, 0.02, 0.27], x_axis=(0.97, 1.02, 0.0))
"""Pose (4, 4) of the camera that watches the scene."""
VIEW = (352, 312)
"""Width and height of the watching camera's pictures [px]."""

_FOCAL = 1.15  # of the watching camera, in widths of its picture
_SUN = np.array([0.35, -0.45, 0.82])
_SKY = (40, 44, 52)


class Watcher:
    """The camera beside the table: drawn by GL where there is one, else by rays."""

    def __init__(self, model: mujoco.MjModel, backend: str = "auto") -> None:
        self._model = model
        self._camera = WristCamera(model, backend, None, intrinsics=_view_intrinsics(1.0))

    def picture(self, data: mujoco.MjData, T_world_camera: FloatArray = VIEWPOINT) -> Picture:
        """Return a picture (312, 352, 3) of the scene as it is now."""
        if self._camera.backend == "gl":
            picture = self._camera.rgb(data, T_world_camera)
            picture[(picture == 0).all(axis=-1)] = _SKY  # where GL drew nothing
            return picture
        return self._cast(data, T_world_camera)

    def close(self) -> None:
        self._camera.close()

    def _cast(self, data: mujoco.MjData, T_world_camera: FloatArray) -> Picture:
        model = self._model
        hits = cast_rays(model, data, _view_intrinsics(0.5), T_world_camera)
        material = model.geom_matid
        rgba = (
            np.where(material[:, None] >= 0, model.mat_rgba[material], model.geom_rgba)
            if model.nmat
            else None
        )
        colours = (model.geom_rgba if rgba is None else rgba)[:, :3] * 255
        light = 0.45 + 0.55 * np.clip(hits.normal @ _SUN, 0, 1)
        picture = colours[hits.geom] * light[..., None]
        picture[hits.geom < 0] = _SKY
        return np.asarray(
            cv2.resize(picture.astype(np.uint8), VIEW, interpolation=cv2.INTER_LINEAR), np.uint8
        )


def _view_intrinsics(scale: float) -> CameraIntrinsics:
    width, height = round(VIEW[0] * scale), round(VIEW[1] * scale)
    focal = _FOCAL * width
    return CameraIntrinsics(
        fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2, width=width, height=height
    )
