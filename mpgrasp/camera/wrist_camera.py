"""The wrist camera: the same depth image rasterised through OpenGL or ray-cast without any; colour with GL.

MuJoCo's camera axes (x right, y up, z backward) become OpenCV's (x right, y down, z forward) here and
nowhere else.
"""

from __future__ import annotations

import functools
import logging
from dataclasses import replace
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.camera import noise as sensor_noise
from mpgrasp.camera.backends import BACKENDS
from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.camera.noise import DepthNoise
from mpgrasp.camera.rasteriser import Rasteriser, require_gl
from mpgrasp.camera.ray_caster import RayCaster
from mpgrasp.camera.standing_errors import NO_ERRORS
from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.exceptions import CameraError, ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.linear_algebra import product

WRIST = "panda/wrist"
"""Name of the camera in a model."""

_MUJOCO_TO_OPENCV = np.array([1.0, -1.0, -1.0])
_DEFAULT_NOISE = DepthNoise()
_log = logging.getLogger(__name__)


class WristCamera:
    """Depth images of a model from its wrist camera, or from any pose.

    Args:
        model: the world; it may lack the wrist camera where only `render` is used.
        backend: "gl", "ray" or "auto", which takes GL where there is one.
        noise: sensor model, or None for perfect depth.
        intrinsics: geometry of the sensor's whole image.
        crop: side of the central square of the image that is wanted [px]; None for all of it. Nothing else is
            computed, apart from the margin that the noise needs, and frames have this size.
        geom_groups: the geom groups that are seen (MuJoCo's convention: 0-2 visual, 3-5 hidden).
        colour: frames carry `rgb` too, which only GL can draw.

    Raises:
        ConfigError: unknown backend, or a crop larger than the image.
        CameraError: backend "gl" without GL, or colour without it.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        backend: str = "auto",
        noise: DepthNoise | None = _DEFAULT_NOISE,
        *,
        intrinsics: CameraIntrinsics = D435_INTRINSICS,
        crop: int | None = None,
        geom_groups: tuple[int, ...] = (0, 1, 2),
        colour: bool = False,
    ) -> None:
        if backend not in BACKENDS:
            raise ConfigError("unknown camera backend", got=backend, allowed=BACKENDS)
        if colour:
            _require_colour(backend)
        self.backend: Literal["gl", "ray"] = "ray" if backend == "ray" or not _gl_usable(backend) else "gl"
        self.colour = colour
        self.noise = noise
        self.intrinsics = intrinsics if crop is None else intrinsics.centre_crop(crop)
        # the shadow of an edge depends on what lies to its right, so that much more is looked at
        margin = 0 if noise is None or crop is None else noise.margin_px(intrinsics)
        self._model = model
        self._geom_groups = geom_groups
        self._seen = replace(self.intrinsics, width=self.intrinsics.width + margin)
        self._ray_caster: RayCaster | None = None
        self._depth_rasteriser: Rasteriser | None = None
        self._colour_rasteriser: Rasteriser | None = None
        self._fine_rasteriser: Rasteriser | None = None
        self.errors = NO_ERRORS
        """Errors that stand for the episode; `capture` has them, `render` has none."""

    @property
    def image(self) -> CameraIntrinsics:
        """Geometry of the image that is looked at: the frames' with the margin that the noise needs."""
        return self._seen

    def pose(self, data: mujoco.MjData) -> FloatArray:
        """`T_world_camera` (4, 4) of the model's camera, OpenCV axes, as of the last forward kinematics."""
        index = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_CAMERA.value, WRIST)
        if index < 0:
            names = [self._model.camera(i).name for i in range(self._model.ncam)]
            raise CameraError(
                "the model has no such camera", got=WRIST, allowed=names or "none in this model"
            )
        return transform(data.cam_xmat[index].reshape(3, 3) * _MUJOCO_TO_OPENCV, data.cam_xpos[index])

    def capture(self, data: mujoco.MjData, rng: np.random.Generator) -> DepthFrame:
        """Depth that the sensor reports from the model's camera, and the pose in which it is believed."""
        T, errors = self.pose(data), self.errors
        depth = self._depth(data, T)
        pattern = None if errors.pattern is None else errors.pattern.at(float(data.time))
        depth = self._measured(depth, rng, pattern)
        if errors.patches is not None:
            depth = np.where(errors.patches.lost(data, self._seen, T), np.float32(np.nan), depth)
        frame = self._frame(data, T, depth)
        if errors.calibration is None:
            return frame
        return replace(frame, T_world_camera=product(T, errors.calibration))

    def render(
        self, data: mujoco.MjData, T_world_camera: FloatArray, rng: np.random.Generator | None = None
    ) -> DepthFrame:
        """Depth from an OpenCV camera at `T_world_camera` (4, 4); with the sensor's noise if `rng` is."""
        depth = self._depth(data, T_world_camera)
        if rng is not None:
            depth = self._measured(depth, rng)
        return self._frame(data, T_world_camera, depth)

    def render_both(
        self,
        data: mujoco.MjData,
        T_world_camera: FloatArray,
        rng: np.random.Generator,
        pattern: NDArray[np.float32] | None = None,
    ) -> tuple[DepthFrame, DepthFrame]:
        """Depth that the sensor reports from `T_world_camera` (4, 4), and the perfect depth of that image.

        Args:
            data: state of the model.
            T_world_camera: pose of an OpenCV camera.
            rng: source of the noise.
            pattern: (H, W) disparity error that stays, of `image`'s size [px of the sensor].
        """
        true = self._depth(data, T_world_camera)
        reported = self._frame(data, T_world_camera, self._measured(true, rng, pattern))
        return reported, replace(reported, depth=self._window(true))

    def rgb(self, data: mujoco.MjData, T_world_camera: FloatArray | None = None) -> NDArray[np.uint8]:
        """Colour image (H, W, 3) with the geometry of the frames, shadows and all, for recordings; needs GL.

        Raises:
            CameraError: there is no GL on this machine.
        """
        if self._fine_rasteriser is None:
            self._fine_rasteriser = Rasteriser(
                self._model, self.intrinsics, colour=True, fine=True, geom_groups=self._geom_groups
            )
        return self._fine_rasteriser.render(
            data, self.pose(data) if T_world_camera is None else T_world_camera
        )

    def close(self) -> None:
        """Free GL resources; a later image makes new ones."""
        for rasteriser in (self._depth_rasteriser, self._colour_rasteriser, self._fine_rasteriser):
            if rasteriser is not None:
                rasteriser.close()
        self._depth_rasteriser = self._colour_rasteriser = self._fine_rasteriser = None

    def _frame(
        self, data: mujoco.MjData, T_world_camera: FloatArray, depth: NDArray[np.float32]
    ) -> DepthFrame:
        return DepthFrame(
            depth=self._window(depth),
            intrinsics=self.intrinsics,
            T_world_camera=T_world_camera,
            time=float(data.time),
            rgb=self._colour_image(data, T_world_camera) if self.colour else None,
        )

    def _window(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """The part of an image that is wanted, without the margin that the noise needs."""
        return np.ascontiguousarray(depth[:, : self.intrinsics.width])

    def _measured(
        self,
        depth: NDArray[np.float32],
        rng: np.random.Generator,
        pattern: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        if self.noise is None:
            return depth
        return sensor_noise.apply(depth, self._seen, rng, self.noise, pattern)

    def _colour_image(self, data: mujoco.MjData, T_world_camera: FloatArray) -> NDArray[np.uint8]:
        if self._colour_rasteriser is None:
            self._colour_rasteriser = Rasteriser(
                self._model, self.intrinsics, colour=True, geom_groups=self._geom_groups
            )
        return self._colour_rasteriser.render(data, T_world_camera)

    def _depth(self, data: mujoco.MjData, T_world_camera: FloatArray) -> NDArray[np.float32]:
        if self.backend == "ray":
            if self._ray_caster is None:
                self._ray_caster = RayCaster(self._model, self._seen, geom_groups=self._geom_groups)
            return self._ray_caster.render(data, T_world_camera)
        if self._depth_rasteriser is None:
            self._depth_rasteriser = Rasteriser(self._model, self._seen, geom_groups=self._geom_groups)
        return self._depth_rasteriser.render(data, T_world_camera)


def _require_colour(backend: str) -> None:
    """Raise a CameraError where frames cannot have colour."""
    if backend == "ray":
        raise CameraError("rays see no colour", got='backend "ray"', allowed='backend "gl", or no colour')
    require_gl()


def has_colour(backend: str) -> bool:
    """True if a camera of that backend can see colour here: only OpenGL renders it.

    Raises:
        CameraError: backend "gl" without GL.
    """
    return backend != "ray" and _gl_usable(backend)


def _gl_usable(backend: str) -> bool:
    """True if GL works here; under "gl" it must, under "auto" the log says once that it does not."""
    if backend == "gl":
        require_gl()
        return True
    return _gl_or_notice()


@functools.cache
def _gl_or_notice() -> bool:
    try:
        require_gl()
    except CameraError as error:
        _log.warning("no OpenGL here, so the camera casts rays instead (same images, slower): %s", error)
        return False
    return True
