"""A MuJoCo model's bodies and shapes as rerun entities: shapes once, poses on every tick."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import rerun as rr

from mpgrasp.geometry import FloatArray

_VISIBLE_GROUPS = (0, 1, 2)
_HFIELD_STRIDE = 2  # every second point: the cloth is smooth, and shapes are to be small
_MAX_FLAT_FACES = 20_000


class RerunModel:
    """Logs one model below an entity path, with one entity a body."""

    def __init__(self, stream: rr.RecordingStream, model: mujoco.MjModel, root: str) -> None:
        self._stream, self._model = stream, model
        visible = np.isin(model.geom_group, _VISIBLE_GROUPS)
        self._paths = {
            int(body): f"{root}/{model.body(body).name or f'body_{body}'}"
            for body in np.unique(model.geom_bodyid[visible])
        }
        self._last: dict[int, FloatArray] = {}
        for geom in np.flatnonzero(visible):
            self._log_shape(int(geom))

    def log_poses(self, data: mujoco.MjData) -> None:
        """Poses of all bodies that moved since the last call."""
        for body, path in self._paths.items():
            pose = np.concatenate([data.xpos[body], data.xquat[body]])
            if body in self._last and np.allclose(pose, self._last[body], atol=1e-6):
                continue
            self._last[body] = pose
            self._stream.log(path, rr.Transform3D(translation=pose[:3], quaternion=_xyzw(pose[3:])))

    def _log_shape(self, geom: int) -> None:
        model = self._model
        shape = self._shape(geom)
        if shape is None:
            return
        path = f"{self._paths[int(model.geom_bodyid[geom])]}/{model.geom(geom).name or f'geom_{geom}'}"
        at = rr.Transform3D(translation=model.geom_pos[geom], quaternion=_xyzw(model.geom_quat[geom]))
        self._stream.log(path, at, shape, static=True)

    def _shape(self, geom: int) -> Any:
        model, kinds = self._model, mujoco.mjtGeom
        material = model.geom_matid[geom]
        rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
        colour = np.asarray(np.clip(rgba, 0, 1) * 255, np.uint8)
        kind, size = model.geom_type[geom], model.geom_size[geom]
        solid: dict[str, Any] = {"colors": [colour], "fill_mode": "solid"}
        if colour[3] == 0 or kind == kinds.mjGEOM_PLANE:
            return None  # an endless floor would dwarf everything else
        if kind == kinds.mjGEOM_BOX:
            return rr.Boxes3D(half_sizes=[size], **solid)
        if kind == kinds.mjGEOM_SPHERE:
            return rr.Ellipsoids3D(half_sizes=[np.full(3, size[0])], **solid)
        if kind == kinds.mjGEOM_ELLIPSOID:
            return rr.Ellipsoids3D(half_sizes=[size], **solid)
        if kind == kinds.mjGEOM_CYLINDER:
            return rr.Cylinders3D(lengths=[2 * size[1]], radii=[size[0]], **solid)
        if kind == kinds.mjGEOM_CAPSULE:
            # rerun's capsule starts at its origin, MuJoCo's is centred on it
            return rr.Capsules3D(
                lengths=[2 * size[1]], radii=[size[0]], translations=[[0, 0, -size[1]]], **solid
            )
        if kind == kinds.mjGEOM_MESH:
            return _mesh(*self._mesh(geom), colour)
        if kind == kinds.mjGEOM_HFIELD:
            return _mesh(*self._height_field(geom), colour)
        return None

    def _mesh(self, geom: int) -> tuple[FloatArray, np.ndarray]:
        mesh = self._model.mesh(self._model.geom_dataid[geom])
        v0, nv = int(mesh.vertadr[0]), int(mesh.vertnum[0])
        f0, nf = int(mesh.faceadr[0]), int(mesh.facenum[0])
        return self._model.mesh_vert[v0 : v0 + nv], self._model.mesh_face[f0 : f0 + nf]

    def _height_field(self, geom: int) -> tuple[FloatArray, np.ndarray]:
        field = self._model.hfield(self._model.geom_dataid[geom])
        nrow, ncol = int(field.nrow[0]), int(field.ncol[0])
        half_x, half_y, top, _ = field.size
        height = field.data.reshape(nrow, ncol)[::_HFIELD_STRIDE, ::_HFIELD_STRIDE] * top
        rows, cols = height.shape
        x = np.linspace(-half_x, half_x, ncol)[::_HFIELD_STRIDE]
        y = np.linspace(-half_y, half_y, nrow)[::_HFIELD_STRIDE]
        points = np.stack([*np.meshgrid(x, y), height], axis=-1).reshape(-1, 3)
        corner = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
        lower = np.stack([corner, corner + 1, corner + cols + 1], axis=1)
        upper = np.stack([corner, corner + cols + 1, corner + cols], axis=1)
        return points, np.concatenate([lower, upper])


def _mesh(vertices: FloatArray, faces: np.ndarray, colour: np.ndarray) -> rr.Mesh3D:
    """Mesh with normals, without which it would be drawn without shading."""
    corners = vertices[faces]  # (n, 3, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # twice the area long
    if len(faces) <= _MAX_FLAT_FACES // 4:
        points, indices = corners.reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
        normals = np.repeat(normals, 3, axis=0)
    else:
        points, indices = vertices, faces
        sums = np.zeros((len(vertices), 3))
        for k in range(3):
            np.add.at(sums, faces[:, k], normals)
        normals = sums
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return rr.Mesh3D(
        vertex_positions=np.asarray(points, np.float32),
        triangle_indices=np.asarray(indices, np.uint32),
        vertex_normals=np.asarray(normals, np.float32),
        albedo_factor=colour,
    )


def _xyzw(wxyz: FloatArray) -> rr.Quaternion:
    return rr.Quaternion(xyzw=np.roll(wxyz, -1))
