"""Depth and colour images through OpenGL, off screen, at exact pinhole intrinsics.

MuJoCo's own `Renderer` takes its frustum from the model; here it comes from `CameraIntrinsics`, so that any
window of an image is drawn alone, with the very pixels it would have in the whole. Multisampling is off for
depth: a resolved depth sample does not lie at the pixel's centre.
"""

from __future__ import annotations

import contextlib
import functools
import os
import platform
import threading
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.camera.height_field_mesh import height_field_mesh
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.exceptions import CameraError
from mpgrasp.forking import OPENGL, refuse_inherited, starting
from mpgrasp.geometry import FloatArray

NEAR = 0.02
"""Whatever is nearer than this z-depth is not seen [m]."""
FAR = 5.0
"""Whatever is farther than this z-depth is not seen [m]."""

_SPARE_GEOMS = 100
_CATEGORIES = mujoco.mjtCatBit.mjCAT_STATIC.value | mujoco.mjtCatBit.mjCAT_DYNAMIC.value
_SHADOW_MAP = 1024
_COLOUR_SAMPLES = 4
_SLICES = 64

_left_behind: list[Any] = []  # that it would take another thread or process to free


def require_gl() -> None:
    """Make sure that GL works; it is tried once in a process.

    Raises:
        CameraError: there is no GL on this machine.
    """
    error = _gl_error()
    if error is not None:
        raise error


@functools.cache
def _gl_error() -> CameraError | None:
    try:
        context = _new_gl_context()
    except CameraError as error:
        return error
    try:
        # glfw without a display only complains: what counts is whether MuJoCo can draw
        mujoco.MjrContext(mujoco.MjSpec().compile(), mujoco.mjtFontScale.mjFONTSCALE_50.value).free()
    except Exception as error:
        return _no_gl(error)
    finally:
        context.free()
    return None


def _no_gl(error: Exception) -> CameraError:
    return CameraError(
        f"OpenGL cannot be initialised: {type(error).__name__}: {error}",
        allowed='a machine with EGL (libegl1 and a driver such as Mesa), or backend "ray" without GL',
    )


def _new_gl_context() -> Any:
    """A current off-screen GL context; EGL on Linux unless `MUJOCO_GL` asks for another.

    Raises:
        ConfigError: this process was forked from one with OpenGL, in which no frame would ever come.
        CameraError: there is no GL on this machine.
    """
    starting(OPENGL)
    # Mesa draws on the processor in the thread that asks: our images are too small for more of them to help
    os.environ.setdefault("LP_NUM_THREADS", "0")
    try:
        if platform.system() == "Linux" and not os.environ.get("MUJOCO_GL"):
            # mujoco picks glfw by itself, which needs a display
            from mujoco.egl import GLContext
        else:
            from mujoco import GLContext
        context = GLContext(64, 64)
        context.make_current()
    except Exception as error:  # each platform's binding raises types of its own
        raise _no_gl(error) from error
    return context


@contextlib.contextmanager
def _visual_settings(model: mujoco.MjModel, width: int, height: int, fine: bool) -> Iterator[None]:
    """Have the model ask for a buffer of our size while a context is made from it, then restore it."""
    glob, quality = model.vis.global_, model.vis.quality
    kept = (
        glob.offwidth,
        glob.offheight,
        quality.offsamples,
        quality.shadowsize,
        quality.numslices,
        quality.numstacks,
    )
    glob.offwidth, glob.offheight = width, height
    quality.offsamples = _COLOUR_SAMPLES if fine else 0
    quality.shadowsize = _SHADOW_MAP if fine else 0
    quality.numslices, quality.numstacks = _SLICES, _SLICES
    try:
        yield
    finally:
        (
            glob.offwidth,
            glob.offheight,
            quality.offsamples,
            quality.shadowsize,
            quality.numslices,
            quality.numstacks,
        ) = kept


class Rasteriser:
    """Draws one model into images of one size.

    Args:
        model: the world to draw.
        intrinsics: geometry of the image.
        colour: draw colour instead of depth.
        fine: colour multisampled and with shadows, for people to look at, in place of quick and plain.
        geom_groups: the geom groups that are seen.

    Raises:
        CameraError: there is no GL on this machine.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        intrinsics: CameraIntrinsics,
        *,
        colour: bool = False,
        fine: bool = False,
        geom_groups: tuple[int, ...] = (0, 1, 2),
    ) -> None:
        fine = fine and colour
        self._owner = _here()
        self._model = model
        self._intrinsics = intrinsics
        self._colour = colour
        # A GL context of its own: two MuJoCo contexts in one GL context draw into each other's buffers.
        self._gl = _new_gl_context()
        with _visual_settings(model, intrinsics.width, intrinsics.height, fine):
            self._context: mujoco.MjrContext | None = mujoco.MjrContext(
                model, mujoco.mjtFontScale.mjFONTSCALE_50.value
            )
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._scene = mujoco.MjvScene(model, maxgeom=model.ngeom + _SPARE_GEOMS)
        self._rect = mujoco.MjrRect(0, 0, intrinsics.width, intrinsics.height)
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = [group in geom_groups for group in range(mujoco.mjNGROUP)]
        for decoration in ("sitegroup", "jointgroup", "tendongroup", "actuatorgroup"):
            getattr(self._option, decoration)[:] = 0
        self._free_camera = mujoco.MjvCamera()
        flags = self._scene.flags
        self._field = None if colour else height_field_mesh(model)
        if not colour:
            flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = True
        if not fine:
            flags[mujoco.mjtRndFlag.mjRND_SHADOW] = flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False

    def render(self, data: mujoco.MjData, T_world_camera: FloatArray) -> NDArray[Any]:
        """The image seen from an OpenCV camera at `T_world_camera` (4, 4).

        Returns:
            (H, W) float32 z-depth [m], NaN where nothing is seen; or (H, W, 3) uint8 colour.

        Raises:
            CameraError: it was closed, or made by another thread.
            ConfigError: it was made before this process was forked.
        """
        if self._context is None:
            raise CameraError("the camera was closed", allowed="a new camera")
        self._check_owner()
        self._gl.make_current()
        if not self._colour:
            _mask_colour()
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._free_camera, _CATEGORIES, self._scene
        )
        for eye in self._scene.camera:
            self._place(eye, T_world_camera)
        field, i = self._field, self._intrinsics
        triangles = None if field is None else field.take_over(self._scene, data, T_world_camera, i)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        if field is not None and triangles is not None:
            field.draw(data, T_world_camera, _projection(i), triangles)
        shape = (self._intrinsics.height, self._intrinsics.width)
        if self._colour:
            rgb = np.empty((*shape, 3), np.uint8)
            mujoco.mjr_readPixels(rgb, None, self._rect, self._context)
            return np.ascontiguousarray(rgb[::-1])
        buffer = np.empty(shape, np.float32)
        mujoco.mjr_readPixels(None, buffer, self._rect, self._context)
        return _z_depth(buffer[::-1])

    def _place(self, eye: Any, T_world_camera: FloatArray) -> None:
        """Give one of MuJoCo's two (stereo) eyes our pose and frustum."""
        i = self._intrinsics
        eye.pos, eye.forward, eye.up = T_world_camera[:3, 3], T_world_camera[:3, 2], -T_world_camera[:3, 1]
        # integers are pixel centres, so the image ends half a pixel outside of the first and last
        eye.frustum_top, eye.frustum_bottom = (
            NEAR * (i.cy + 0.5) / i.fy,
            NEAR * (i.cy + 0.5 - i.height) / i.fy,
        )
        eye.frustum_center = NEAR * (i.width / 2 - 0.5 - i.cx) / i.fx
        eye.frustum_width = NEAR * (i.width / 2) / i.fx  # MuJoCo's name for half of it
        eye.frustum_near, eye.frustum_far = NEAR, FAR
        eye.orthographic = 0

    def close(self) -> None:
        """Free the GL resources; the object is of no use afterwards.

        Another thread than the maker's, or a forked process, cannot free them: they last as long as it does.
        """
        context, self._context = self._context, None
        if context is not None:
            if self._owner != _here():
                _left_behind.append((context, self._gl))
                return
            self._gl.make_current()
            context.free()
            self._gl.free()

    def _check_owner(self) -> None:
        """Raise an error unless this is the process and the thread that made the GL context."""
        if self._owner != _here():
            refuse_inherited(OPENGL)
            raise CameraError(
                "a camera is used in another thread than the one that made it",
                got=threading.current_thread().name,
                allowed='one camera for each thread, as OpenGL asks for, or backend "ray"',
            )

    def __del__(self) -> None:
        # MuJoCo's context has to be freed under its own GL context; at exit that may be gone already
        with contextlib.suppress(Exception):
            self.close()


def _here() -> tuple[int, int]:
    return os.getpid(), threading.get_ident()


def _mask_colour() -> None:
    """Have the current GL context draw depth alone, which takes a fifth less time without a graphics card."""
    # MuJoCo's own way to GL, which knows its platform only once there is a context
    from OpenGL import GL  # type: ignore[import-untyped]

    GL.glColorMask(False, False, False, False)


@functools.lru_cache(maxsize=8)
def _projection(i: CameraIntrinsics) -> FloatArray:
    """Clip space (4, 4) of axes x right, y up, z backward, as MuJoCo has it: depth 1 at NEAR and 0 at FAR."""
    right, down = 1 - (2 * i.cx + 1) / i.width, 1 - (2 * i.cy + 1) / i.height
    slope = NEAR / (FAR - NEAR)
    return np.array(
        [
            [2 * i.fx / i.width, 0, right, 0],
            [0, 2 * i.fy / i.height, -down, 0],
            [0, 0, slope, FAR * slope],
            [0, 0, -1, 0],
        ]
    )


def _z_depth(buffer: NDArray[np.float32]) -> NDArray[np.float32]:
    """Z-depth [m] of a reversed depth buffer (1 at NEAR, 0 at FAR), NaN where the buffer is empty."""
    z = np.float32(NEAR * FAR) / (buffer * np.float32(FAR - NEAR) + np.float32(NEAR))
    z[buffer <= 0] = np.nan
    return z
