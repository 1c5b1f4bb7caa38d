"""Depth images by one ray through every pixel's centre: no GL, and the same geometry as with it.

MuJoCo's own rays cost a microsecond each, most of it for the height field. So planes, height fields and
convex bodies are met by all rays of their part of the image at once, and MuJoCo is asked only for the rays
near anything else, or that nothing quicker could settle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.camera.convex_rays import Solid, solids
from mpgrasp.camera.height_field_rays import height_field_depth
from mpgrasp.camera.rasteriser import FAR, NEAR
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import FloatArray, invert, transform_points
from mpgrasp.linear_algebra import product

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

_PLANE = mujoco.mjtGeom.mjGEOM_PLANE.value
_HEIGHT_FIELD = mujoco.mjtGeom.mjGEOM_HFIELD.value
_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_EDGES = np.array([(i, j) for i in range(8) for j in range(i) if (i ^ j) in (1, 2, 4)]).T
_MARGIN = 1  # [px] by which windows are too large, for rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class RayHits:
    """Depth, geom and normal that the rays of an image met."""

    depth: NDArray[np.float32]
    """(H, W) z-depth [m], NaN where nothing was met."""
    geom: NDArray[np.int32]
    """(H, W) index of the geom, -1 where none."""
    normal: FloatArray
    """(H, W, 3) surface normal in the world; zero where none."""


def cast_rays(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    intrinsics: CameraIntrinsics,
    T_world_camera: FloatArray,
    geom_groups: tuple[int, ...] = (0, 1, 2),
) -> RayHits:
    """Depth, geom and normal at every pixel of an OpenCV camera at `T_world_camera` (4, 4)."""
    shape = (intrinsics.height, intrinsics.width)
    directions = product(T_world_camera[:3, :3], _pixel_rays(intrinsics).reshape(3, -1)).T
    normal = np.zeros(directions.size)
    distance, geom = mujoco_rays(
        model, data, T_world_camera[:3, 3], directions, _groups(geom_groups), normal=normal
    )
    geom[np.isnan(distance)] = -1
    return RayHits(
        depth=distance.astype(np.float32).reshape(shape),
        geom=geom.reshape(shape),
        normal=normal.reshape(*shape, 3),
    )


class RayCaster:
    """Depth images of one model in one size.

    Args:
        model: the world to look at; its geoms keep their shapes.
        intrinsics: geometry of the image.
        geom_groups: the geom groups that are seen.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        intrinsics: CameraIntrinsics,
        *,
        geom_groups: tuple[int, ...] = (0, 1, 2),
    ) -> None:
        self._model = model
        self._intrinsics = intrinsics
        self._groups = _groups(geom_groups)
        self._rays = _pixel_rays(intrinsics)
        self._rays32 = self._rays.astype(np.float32)
        self._solids = [solids(model, geom) for geom in range(model.ngeom)]

    def render(self, data: mujoco.MjData, T_world_camera: FloatArray) -> NDArray[np.float32]:
        """Z-depth (H, W) [m] seen by an OpenCV camera at `T_world_camera` (4, 4), NaN where none."""
        model = self._model
        shape = (self._intrinsics.height, self._intrinsics.width)
        inverse = np.zeros(shape, np.float32)
        among_all, among_moving = np.zeros(shape, bool), np.zeros(shape, bool)
        for geom, window in self._in_view(data, T_world_camera):
            turn = data.geom_xmat[geom].reshape(3, 3).T
            rotation, origin = (
                product(turn, T_world_camera[:3, :3]),
                product(turn, T_world_camera[:3, 3] - data.geom_xpos[geom]),
            )
            rays = self._rays32[:, *window]
            layers: list[tuple[Image, Mask | None]]
            if self._solids[geom]:
                layers = [_solid(solid, rotation, origin, rays) for solid in self._solids[geom]]
            elif model.geom_type[geom] == _PLANE:
                layers = [(_plane(model.geom_size[geom], rotation, origin, rays), None)]
            elif model.geom_type[geom] == _HEIGHT_FIELD:
                layers = [_height_field(model, int(model.geom_dataid[geom]), rotation, origin, rays)]
            else:
                fixed = model.body_weldid[model.geom_bodyid[geom]] == 0
                (among_all if fixed else among_moving)[window] = True
                continue
            for met, unknown in layers:
                np.maximum(inverse[window], met, out=inverse[window])
                if unknown is not None:
                    among_all[window] |= unknown
        self._ask(inverse, among_moving & ~among_all, data, T_world_camera, fixed=False)
        inverse[among_all] = 0  # MuJoCo sees everything there
        self._ask(inverse, among_all, data, T_world_camera, fixed=True)
        inverse[inverse < 1 / FAR] = np.nan
        return np.divide(1, inverse, out=inverse)

    def _ask(self, inverse: Image, where: Mask, data: mujoco.MjData, T: FloatArray, *, fixed: bool) -> None:
        """Have MuJoCo cast the rays of some pixels, at moving geoms or at `fixed` ones too."""
        if not where.any():
            return
        directions = product(T[:3, :3], self._rays[:, where]).T
        distance, _ = mujoco_rays(self._model, data, T[:3, 3], directions, self._groups, fixed=fixed)
        inverse[where] = np.fmax(inverse[where], 1 / distance)

    def _in_view(
        self, data: mujoco.MjData, T_world_camera: FloatArray
    ) -> Iterator[tuple[int, tuple[slice, slice]]]:
        """Geoms that may be seen, each with the part of the image that its bounding box covers."""
        model, i = self._model, self._intrinsics
        alpha, material = model.geom_rgba[:, 3].copy(), model.geom_matid >= 0
        alpha[material] = model.mat_rgba[model.geom_matid[material], 3]
        seen = self._groups[np.clip(model.geom_group, 0, mujoco.mjNGROUP - 1)].astype(bool) & (alpha > 0)
        geoms = np.flatnonzero(seen)
        local = model.geom_aabb[geoms, None, :3] + model.geom_aabb[geoms, None, 3:] * _CORNERS
        world = (
            np.einsum("gci,gji->gcj", local, data.geom_xmat[geoms].reshape(-1, 3, 3))
            + data.geom_xpos[geoms, None]
        )
        corners = transform_points(invert(T_world_camera), world)
        # what is left of a box beyond the near plane has its corners there too
        a, b = corners[:, _EDGES[0]], corners[:, _EDGES[1]]
        with np.errstate(divide="ignore", invalid="ignore"):
            part = (NEAR - a[..., 2:]) / (b[..., 2:] - a[..., 2:])
            crossing = np.where((part >= 0) & (part <= 1), a + part * (b - a), 0.0)
            points = np.concatenate([corners, crossing], axis=1)
            ahead = points[..., 2] >= NEAR * (1 - 1e-9)
            u = i.fx * points[..., 0] / points[..., 2] + i.cx
            v = i.fy * points[..., 1] / points[..., 2] + i.cy
        spans = np.column_stack([*_span(v, ahead, i.height), *_span(u, ahead, i.width)])
        spans[model.geom_type[geoms] == _PLANE] = (0, i.height, 0, i.width)
        for geom, (top, bottom, left, right) in zip(geoms.tolist(), spans.tolist(), strict=True):
            if top < bottom and left < right:
                yield geom, (slice(top, bottom), slice(left, right))


def _solid(solid: Solid, rotation: FloatArray, origin: FloatArray, rays: Image) -> tuple[Image, Mask | None]:
    """Inverse depth of a solid, 0 beside it; and the pixels where it reaches through the near plane."""
    enter, leave = solid.inverse_depth(rotation, origin, rays.reshape(3, -1))
    enter[enter < leave] = 0
    near = (enter > 1 / NEAR) & (leave < 1 / NEAR)
    enter[(enter < 0) | (enter > 1 / NEAR)] = 0
    shape = rays.shape[1:]
    return enter.reshape(shape), near.reshape(shape) if near.any() else None


def _plane(size: FloatArray, rotation: FloatArray, origin: FloatArray, rays: Image) -> Image:
    """Inverse depth of the front of a plane geom, 0 where it is not met."""
    x, y, z = np.einsum("ij,j...->i...", rotation.astype(np.float32), rays)
    if origin[2] <= 0:
        return np.zeros_like(x)
    inverse: Image = z * np.float32(-1 / origin[2])
    inverse[(inverse < 0) | (inverse > 1 / NEAR)] = 0
    for along, start, half in ((x, origin[0], size[0]), (y, origin[1], size[1])):
        if half > 0:  # 0 stands for an infinite one
            inverse[np.abs(along + np.float32(start) * inverse) > np.float32(half) * inverse] = 0
    return inverse


def _height_field(
    model: mujoco.MjModel, field: int, rotation: FloatArray, origin: FloatArray, rays: Image
) -> tuple[Image, Mask]:
    """Inverse depth of a height field, 0 beside it; and the pixels where it is not known."""
    x, y, z = np.einsum("ij,j...->i...", rotation.astype(np.float32), rays)
    depth, unknown = height_field_depth(model, field, origin, (x, y, z))
    unknown |= depth < NEAR
    depth[unknown] = np.inf
    return np.divide(1, depth, out=depth), unknown


def mujoco_rays(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    origin: FloatArray,
    directions: FloatArray,
    groups: NDArray[np.uint8],
    *,
    fixed: bool = True,
    normal: FloatArray | None = None,
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Return the first thing that MuJoCo's own rays meet between the near and the far plane.

    Args:
        model: the world.
        data: its state.
        origin: (3,) start of all rays [m].
        directions: (n, 3) world axes, of unit z along the camera's axis, so that distances are z-depths.
        groups: (6,) the geom groups that are seen.
        fixed: look at geoms that cannot move as well.
        normal: (3 n,) to be filled with the surface normals.

    Returns:
        (n,) z-depth [m], NaN where nothing is met; and (n,) geoms.
    """
    n = len(directions)
    origin, directions = np.array(origin, float), np.ascontiguousarray(directions)
    distance, geom = np.empty(n), np.empty(n, np.int32)
    mujoco.mj_multiRay(
        model, data, origin, directions.reshape(-1), groups, fixed, -1, geom, distance, normal, n, FAR
    )
    for i in np.flatnonzero((distance >= 0) & (distance < NEAR)):
        # look past what the near plane of the rasterised image would cut away
        start, there = origin + NEAR * directions[i], slice(3 * i, 3 * i + 3)
        facing = None if normal is None else normal[there]
        beyond = mujoco.mj_ray(model, data, start, directions[i], groups, fixed, -1, geom[i : i + 1], facing)
        distance[i] = beyond + NEAR if beyond >= 0 else -1
    distance[(distance < 0) | (distance > FAR)] = np.nan
    return distance, geom


def _groups(geom_groups: tuple[int, ...]) -> NDArray[np.uint8]:
    return np.array([group in geom_groups for group in range(mujoco.mjNGROUP)], np.uint8)


def _pixel_rays(intrinsics: CameraIntrinsics) -> FloatArray:
    """Camera-frame directions (3, H, W) of all pixels, scaled to z = 1."""
    v, u = np.indices((intrinsics.height, intrinsics.width)).astype(float)
    return np.ascontiguousarray(np.moveaxis(intrinsics.deproject(u, v, np.ones(u.shape)), -1, 0))


def _span(at: FloatArray, counts: Mask, size: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and one past the last of `size` pixels between the positions (n, m) that count, (n,) each."""
    low = np.min(at, axis=1, where=counts, initial=size + _MARGIN)
    high = np.max(at, axis=1, where=counts, initial=-1 - _MARGIN)
    first = np.clip(np.floor(low) - _MARGIN, 0, size)
    return first.astype(np.int64), np.clip(np.ceil(high) + _MARGIN + 1, 0, size).astype(np.int64)
