"""Height fields in depth images: of a large one the part that is in view, and nothing that it hides.

MuJoCo draws all triangles of a height field, and whatever it covers. Without a graphics card that is most of
an image's cost, since a rasteriser in software pays for every triangle in view. The same triangles
drawn here give the same depth, up to rounding.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.linear_algebra import product

_FIELD = mujoco.mjtGeom.mjGEOM_HFIELD.value
_UNDRAWN = mujoco.mjtGeom.mjGEOM_NONE.value
_GEOM = mujoco.mjtObj.mjOBJ_GEOM.value
_PLANE, _BOX = mujoco.mjtGeom.mjGEOM_PLANE.value, mujoco.mjtGeom.mjGEOM_BOX.value
_FLATTEST = -0.2
"""Fall of a ray over its depth; where one falls less, the part in view may have no end: MuJoCo draws it."""
_CLEARANCE = 0.03
"""Least height of the camera above all of the field [m], beyond the near plane."""
_MARGIN = 1.0  # [px] around the image, for rounding


class HeightFieldMesh:
    """Draws the height field of one geom into the current GL context, after MuJoCo has drawn all else.

    Only a field whose border lies at its zero can be drawn so, such as a cloth on a table: MuJoCo's
    drawing closes a field below its border, and that part is left out here.

    Args:
        model: the world.
        geom: index of the height field's geom.
    """

    def __init__(self, model: mujoco.MjModel, geom: int) -> None:
        self._geom = geom
        heights, self._size = _heights(model, geom), model.hfield_size[model.geom_dataid[geom]]
        self._shape = heights.shape
        self._top = float(heights.max())
        self._below = _hidden_below(model, geom)
        self._buffer: Any = None
        rows, cols = self._shape
        x, y = np.linspace(-1, 1, cols) * self._size[0], np.linspace(-1, 1, rows) * self._size[1]
        self._vertices = np.empty((rows, cols, 3), np.float32)
        self._vertices[..., 0], self._vertices[..., 1], self._vertices[..., 2] = x, y[:, None], heights
        index = np.arange(rows * cols, dtype=np.uint32).reshape(rows, cols)
        low, right, up, across = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
        # each square is split along its diagonal from (row, col) to (row + 1, col + 1), as MuJoCo does
        self._triangles = np.stack([low, right, across, low, across, up], axis=-1)

    def take_over(
        self, scene: mujoco.MjvScene, data: mujoco.MjData, T: FloatArray, intrinsics: CameraIntrinsics
    ) -> NDArray[np.uint32] | None:
        """Take the field out of MuJoCo's scene, and with it what it hides, where it can be drawn here.

        Args:
            scene: all that MuJoCo would draw, as `mjv_updateScene` has left it.
            data: state of the model, kinematics computed.
            T: (4, 4) pose of the OpenCV camera.
            intrinsics: geometry of its image.

        Returns:
            Corners of the triangles to draw, two for each square that may be in view; None if MuJoCo draws
            the field, or nothing shows it.
        """
        geoms = {
            geom.objid: geom
            for geom in scene.geoms[: scene.ngeom]
            if geom.objtype == _GEOM and (geom.objid == self._geom or geom.objid in self._below)
        }
        if self._geom not in geoms:
            return None
        view = self._window(data, T, intrinsics)
        if view is None:
            return None
        window, fills = view
        for index, geom in geoms.items():
            if fills or index == self._geom:
                geom.type = _UNDRAWN
        return np.ascontiguousarray(self._triangles[window])

    def draw(self, data: mujoco.MjData, T: FloatArray, frustum: FloatArray, triangles: Any) -> None:
        """Draw triangles of `take_over` over what is in the current GL context's buffers.

        Args:
            data: state of the model, kinematics computed.
            T: (4, 4) pose of the OpenCV camera.
            frustum: (4, 4) projection from axes x right, y up, z backward to clip space.
            triangles: what `take_over` has returned.
        """
        from OpenGL import GL  # type: ignore[import-untyped]

        # bare, because PyOpenGL's own keeps the pointer by a context that it does not find where something
        # has imported PyOpenGL before MuJoCo could name its platform
        from OpenGL.raw.GL.VERSION.GL_1_1 import glVertexPointer  # type: ignore[import-untyped]

        # one vertex array and one draw call, in the fixed pipeline that MuJoCo itself uses
        GL.glMatrixMode(GL.GL_PROJECTION)
        GL.glLoadMatrixf(frustum.T)
        GL.glMatrixMode(GL.GL_MODELVIEW)
        GL.glLoadMatrixf(self._modelview(data, T).T)
        if self._buffer is None:
            self._buffer = GL.glGenBuffers(1)
            GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffer)
            GL.glBufferData(GL.GL_ARRAY_BUFFER, self._vertices.nbytes, self._vertices, GL.GL_STATIC_DRAW)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._buffer)
        GL.glEnableClientState(GL.GL_VERTEX_ARRAY)
        glVertexPointer(3, GL.GL_FLOAT, 0, ctypes.c_void_p(0))
        GL.glDrawElements(GL.GL_TRIANGLES, triangles.size, GL.GL_UNSIGNED_INT, triangles)
        GL.glDisableClientState(GL.GL_VERTEX_ARRAY)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, 0)

    def _modelview(self, data: mujoco.MjData, T: FloatArray) -> FloatArray:
        """Transform (4, 4) from the field's own frame to the camera's axes in OpenGL."""
        rotation, eye = self._local_camera(data, T)
        turn = (rotation * (1.0, -1.0, -1.0)).T
        return transform(turn, -product(turn, eye))

    def _local_camera(self, data: mujoco.MjData, T: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Orientation (3, 3) and position (3,) of the camera in the field's own frame."""
        rotation = data.geom_xmat[self._geom].reshape(3, 3).T
        return product(rotation, T[:3, :3]), product(rotation, T[:3, 3] - data.geom_xpos[self._geom])

    def _window(
        self, data: mujoco.MjData, T: FloatArray, intrinsics: CameraIntrinsics
    ) -> tuple[tuple[slice, slice], bool] | None:
        """Rows and columns of the squares that may be in view, and True if they fill it.

        None where the camera is not above the field, or looks past its plane.
        """
        rotation, eye = self._local_camera(data, T)
        rays = product(_corner_rays(intrinsics), rotation.T)
        if eye[2] < self._top + _CLEARANCE or rays[:, 2].max() > _FLATTEST:
            return None
        falls = np.array([-eye[2], self._top - eye[2]])[:, None] / rays[:, 2]
        met = (eye[:2] + falls[..., None] * rays[:, :2]).reshape(-1, 2)  # on both planes that bound it
        squares = np.array(self._shape[::-1]) - 1
        at = (met / self._size[:2] + 1) / 2 * squares
        first, last = np.floor(at.min(axis=0)).astype(int), np.ceil(at.max(axis=0)).astype(int)
        fills = bool((first >= 0).all() and (last <= squares).all())
        (left, low), (right, high) = np.clip(first, 0, squares), np.clip(last, 0, squares)
        return (slice(int(low), int(high)), slice(int(left), int(right))), fills


def height_field_mesh(model: mujoco.MjModel) -> HeightFieldMesh | None:
    """Return the mesh of a model's one height field, if there is one whose border lies at its zero."""
    fields = np.flatnonzero(model.geom_type == _FIELD)
    if len(fields) != 1:
        return None
    heights = _heights(model, int(fields[0]))
    border = (heights[0], heights[-1], heights[:, 0], heights[:, -1])
    return None if any(edge.any() for edge in border) else HeightFieldMesh(model, int(fields[0]))


def _heights(model: mujoco.MjModel, geom: int) -> NDArray[np.float32]:
    """Heights (rows, cols) [m] over the frame of a height field's geom."""
    field = model.geom_dataid[geom]
    shape, start = (model.hfield_nrow[field], model.hfield_ncol[field]), model.hfield_adr[field]
    data = model.hfield_data[start : start + shape[0] * shape[1]].reshape(shape)
    return np.asarray(data * model.hfield_size[field, 2], np.float32)


def _hidden_below(model: mujoco.MjModel, field: int) -> frozenset[int]:
    """Upright boxes and planes of the world that lie wholly below the zero of an upright field there."""
    upright = (model.geom_bodyid == 0) & (model.geom_quat[:, 0] == 1)
    if not upright[field]:
        return frozenset()
    height = {_PLANE: 0.0 * model.geom_size[:, 2], _BOX: model.geom_size[:, 2]}
    found = [
        np.flatnonzero(
            upright & (model.geom_type == kind) & (model.geom_pos[:, 2] + above <= model.geom_pos[field, 2])
        )
        for kind, above in height.items()
    ]
    return frozenset(np.concatenate(found).tolist())


@functools.lru_cache(maxsize=8)
def _corner_rays(intrinsics: CameraIntrinsics) -> FloatArray:
    """Rays (4, 3) of unit z through the corners of an image and a margin around it."""
    i = intrinsics
    across = [(u - i.cx) / i.fx for u in (-0.5 - _MARGIN, i.width - 0.5 + _MARGIN)]
    down = [(v - i.cy) / i.fy for v in (-0.5 - _MARGIN, i.height - 0.5 + _MARGIN)]
    return np.array([(x, y, 1.0) for x in across for y in down])
