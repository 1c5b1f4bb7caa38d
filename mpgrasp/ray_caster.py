"""Depth images by one ray through every pixel's centre: no GL, and the same geometry as with it."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import FloatArray
from mpgrasp.rasteriser import FAR, NEAR


@dataclass(frozen=True, kw_only=True, eq=False)
class RayHits:
    """What the rays of an image met."""

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
    n = intrinsics.height * intrinsics.width
    normal = np.zeros(3 * n)
    distance, geom = _cast(model, data, intrinsics, T_world_camera, geom_groups, normal)
    shape = (intrinsics.height, intrinsics.width)
    geom[np.isnan(distance)] = -1
    return RayHits(
        depth=distance.astype(np.float32).reshape(shape),
        geom=geom.reshape(shape),
        normal=normal.reshape(*shape, 3),
    )


def ray_cast(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    intrinsics: CameraIntrinsics,
    T_world_camera: FloatArray,
    geom_groups: tuple[int, ...] = (0, 1, 2),
) -> NDArray[np.float32]:
    """Z-depth (H, W) [m] seen by an OpenCV camera at `T_world_camera` (4, 4); NaN where nothing is met."""
    distance, _ = _cast(model, data, intrinsics, T_world_camera, geom_groups, None)
    return distance.astype(np.float32).reshape(intrinsics.height, intrinsics.width)


def _cast(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    intrinsics: CameraIntrinsics,
    T_world_camera: FloatArray,
    geom_groups: tuple[int, ...],
    normal: FloatArray | None,
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Z-depths (H * W,) and geoms (H * W,); fills `normal` (3 * H * W,) if given."""
    # rays have unit z, not unit length, so that MuJoCo's distance along them is the z-depth
    directions = _pixel_rays(intrinsics) @ T_world_camera[:3, :3].T
    groups = np.array([group in geom_groups for group in range(mujoco.mjNGROUP)], np.uint8)
    n = len(directions)
    distance, geom = np.empty(n), np.empty(n, np.int32)
    origin = np.array(T_world_camera[:3, 3], float)
    mujoco.mj_multiRay(
        model, data, origin, directions.reshape(-1), groups, True, -1, geom, distance, normal, n, FAR
    )
    for i in np.flatnonzero((distance >= 0) & (distance < NEAR)):
        # look past what the near plane of the rasterised image would cut away
        start = origin + NEAR * directions[i]
        beyond = mujoco.mj_ray(
            model,
            data,
            start,
            directions[i],
            groups,
            True,
            -1,
            geom[i : i + 1],
            None if normal is None else normal[3 * i : 3 * i + 3],
        )
        distance[i] = beyond + NEAR if beyond >= 0 else -1
    distance[(distance < 0) | (distance > FAR)] = np.nan
    return distance, geom


@functools.lru_cache(maxsize=8)
def _pixel_rays(intrinsics: CameraIntrinsics) -> FloatArray:
    """Camera-frame directions (H * W, 3) of all pixels, scaled to z = 1."""
    v, u = np.indices((intrinsics.height, intrinsics.width)).astype(float)
    rays = intrinsics.deproject(u, v, np.ones(u.shape)).reshape(-1, 3)
    rays.flags.writeable = False
    return rays
