"""Rays from one point onto convex solids: boxes, balls, cylinders, and those meshes that are convex.

Along the rays of a pinhole image the inverse depth of a plane is a linear function of the ray, so a
polyhedron is the least inverse depth of the faces turned to the camera wherever that is not below the
greatest one of the faces turned away.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import dot, product

_FLAT = 1e-5
"""Vertices may stand out over a face this far [m], and faces this alike are one."""
_MOST_TRIANGLES = 2000
"""Beyond, looking at every face costs more than MuJoCo's search tree."""
_TINY = 1e-9
_BOX = np.vstack([np.eye(3), -np.eye(3)])
_DISC = _BOX[[2, 5]]
_TYPE = mujoco.mjtGeom


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """Intersection of half-spaces and, maybe, of an ellipsoid or an elliptic tube."""

    planes: FloatArray
    """(k, 4) as (n, d): n . x <= d, unit normals [-], distances [m]."""
    scale: FloatArray | None = None
    """(3,) with |scale (x - centre)| <= 1 [1/m], 0 along a tube; None for a polyhedron."""
    centre: FloatArray = field(default_factory=lambda: np.zeros(3))
    """(3,) [m]."""

    def inverse_depth(
        self, rotation: FloatArray, origin: FloatArray, rays: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Inverse depths between which rays are within the solid.

        Args:
            rotation: (3, 3) from the rays' frame into the solid's.
            origin: (3,) start of the rays in the solid's frame [m].
            rays: (3, n) directions of unit z.

        Returns:
            (n,) inverse depth [1/m] where the rays enter, inf for a start within, and (n,) where they leave.
            A ray meets the solid if it enters at a positive one, no less than that where it leaves.
        """
        distance = self.planes[:, 3] - product(self.planes[:, :3], origin)
        # a start on a face's plane sees that face edge-on: a huge slope stands for the infinite one
        distance = np.where(np.abs(distance) < _TINY, _TINY, distance)
        slopes = np.asarray(product(self.planes[:, :3], rotation) / distance[:, None], np.float32)
        near, away = slopes[distance < 0], slopes[distance > 0]
        n = rays.shape[1]
        enter = product(near, rays).min(axis=0) if len(near) else np.full(n, np.inf, np.float32)
        leave = product(away, rays).max(axis=0) if len(away) else np.full(n, -np.inf, np.float32)
        if self.scale is not None:
            first, last = _round(self.scale, rotation, origin - self.centre, rays)
            np.minimum(enter, first, out=enter)
            np.maximum(leave, last, out=leave)
        return enter, leave


def solids(model: mujoco.MjModel, geom: int) -> tuple[Solid, ...]:
    """Convex solids that make up a geom, in its frame; none if it is not made up of such."""
    kind, size = _TYPE(int(model.geom_type[geom])), model.geom_size[geom].astype(float)
    if kind == _TYPE.mjGEOM_BOX:
        return (Solid(planes=np.column_stack([_BOX, np.tile(size, 2)])),)
    if kind == _TYPE.mjGEOM_SPHERE:
        return (_ball(np.full(3, size[0]), np.zeros(3)),)
    if kind == _TYPE.mjGEOM_ELLIPSOID:
        return (_ball(size, np.zeros(3)),)
    if kind in (_TYPE.mjGEOM_CYLINDER, _TYPE.mjGEOM_CAPSULE):
        radius, half = size[:2]
        ends = np.column_stack([_DISC, np.full(2, half)])
        tube = Solid(planes=ends, scale=np.array([1 / radius, 1 / radius, 0.0]))
        if kind == _TYPE.mjGEOM_CYLINDER:
            return (tube,)
        return tube, *(_ball(np.full(3, radius), end * half) for end in _DISC)
    if kind == _TYPE.mjGEOM_MESH:
        return _convex_mesh(model, int(model.geom_dataid[geom]))
    return ()


def _ball(radii: FloatArray, centre: FloatArray) -> Solid:
    return Solid(planes=np.zeros((0, 4)), scale=1 / radii, centre=centre)


def _round(
    scale: FloatArray, rotation: FloatArray, start: FloatArray, rays: NDArray[np.float32]
) -> tuple[FloatArray, FloatArray]:
    """Inverse depths (n,) where rays enter and leave an ellipsoid or tube about the origin."""
    p, d = scale * start, product(scale[:, None] * rotation, rays.astype(float))
    a, b, c = np.einsum("in,in->n", d, d), product(d.T, p), dot(p, p) - 1
    if abs(c) < _TINY:
        c = _TINY
    square = b * b - a * c
    root = np.sqrt(np.maximum(square, 0))
    leave = (-b - root) / c
    if c < 0:
        return np.full(len(b), np.inf), leave
    return np.where((square >= 0) & (b < 0), (root - b) / c, -np.inf), leave


def _convex_mesh(model: mujoco.MjModel, mesh: int) -> tuple[Solid, ...]:
    """The mesh as one solid if it is closed and convex."""
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = model.mesh_vert[start : start + count].astype(float)
    start, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    triangles = model.mesh_face[start : start + count]
    if not 4 <= count <= _MOST_TRIANGLES or not _closed(triangles):
        return ()
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    area = np.linalg.norm(normals, axis=1)
    solid = area > 1e-12  # [m2]; slivers have no direction, and their neighbours close the body
    normals, a = normals[solid] / area[solid, None], a[solid]
    offsets = np.einsum("ij,ij->i", normals, a)
    if not len(normals) or (product(normals, vertices.T).max(axis=1) - offsets).max() > _FLAT:
        return ()
    planes = np.column_stack([normals, offsets])
    _, first = np.unique(np.round(planes / _FLAT), axis=0, return_index=True)
    return (Solid(planes=planes[first]),)


def _closed(triangles: NDArray[np.int32]) -> bool:
    """True if every edge belongs to two triangles, once in each direction."""
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).astype(np.int64)
    size = int(ends.max()) + 1
    there, back = ends[:, 0] * size + ends[:, 1], ends[:, 1] * size + ends[:, 0]
    return len(np.unique(there)) == len(there) and np.array_equal(np.sort(there), np.sort(back))
