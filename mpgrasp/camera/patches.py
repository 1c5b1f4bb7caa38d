"""Patches of objects' surfaces that give no return, as dark or shiny material does.

They are fixed to the surface: every view of an episode finds the same points missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.camera.ray_caster import mujoco_rays
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import FloatArray, invert, transform_points
from mpgrasp.linear_algebra import product

_WAVES = 64
"""Plane waves that a field is the sum of: enough for its values to be Gaussian."""


class Patches:
    """Places of objects' surfaces without return: where a random field in an object's frame is high.

    The field is a sum of plane waves with normally distributed wave vectors, so its correlation over a
    distance d is exp(-(d / size)^2 / 2).

    Args:
        model: the world.
        objects: names of the objects' bodies.
        share: part of the surface without return, on average over all objects (0, 1].
        size: length over which a patch goes on [m].
        rng: source of the fields.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        objects: Sequence[str],
        share: float,
        size: float,
        rng: np.random.Generator,
    ) -> None:
        self._model = model
        self._bodies = [model.body(name).id for name in objects]
        self._waves = rng.standard_normal((len(objects), _WAVES, 3)) / size
        self._phases = rng.uniform(-np.pi, np.pi, (len(objects), _WAVES))
        self._above = NormalDist().inv_cdf(1 - share) if share < 1 else -np.inf

    def lost(
        self, data: mujoco.MjData, intrinsics: CameraIntrinsics, T_world_camera: FloatArray
    ) -> NDArray[np.bool_]:
        """Pixels (H, W) that see such a place, from an OpenCV camera at `T_world_camera` (4, 4)."""
        mask = np.zeros((intrinsics.height, intrinsics.width), bool)
        seen = np.array([1, 1, 1, 0, 0, 0], np.uint8)
        for k, body in enumerate(self._bodies):
            window = self._window(data, intrinsics, T_world_camera, body)
            v, u = (axis.ravel() for axis in np.mgrid[window])
            if not len(u):
                continue
            rays = intrinsics.deproject(u.astype(float), v.astype(float), np.ones(len(u)))  # (n, 3)
            directions = product(rays, T_world_camera[:3, :3].T)
            depth, geom = mujoco_rays(self._model, data, T_world_camera[:3, 3], directions, seen)
            own = np.isfinite(depth) & (self._model.body_rootid[self._model.geom_bodyid[geom]] == body)
            at = T_world_camera[:3, 3] + directions[own] * depth[own, None]
            local = transform_points(invert(_pose(data, body)), at)
            mask[v[own], u[own]] = self.is_lost(k, local)
        return mask

    def is_lost(self, k: int, points: FloatArray) -> NDArray[np.bool_]:
        """True for points (n, 3) [m] in the frame of object k that lie in a patch."""
        phase = product(points, self._waves[k].T) + self._phases[k]
        return np.asarray(np.sqrt(2 / _WAVES) * np.cos(phase).sum(axis=1) > self._above)

    def _window(
        self, data: mujoco.MjData, intrinsics: CameraIntrinsics, T_world_camera: FloatArray, body: int
    ) -> tuple[slice, slice]:
        """Rows and columns that the bounding spheres of a body's geoms cover."""
        geoms = np.flatnonzero(self._model.body_rootid[self._model.geom_bodyid] == body)
        centres = transform_points(invert(T_world_camera), data.geom_xpos[geoms])
        radius = self._model.geom_rbound[geoms]
        near = np.maximum(centres[:, 2] - radius, 1e-3)
        middle = intrinsics.project(np.column_stack([centres[:, :2], np.maximum(centres[:, 2], 1e-3)]))
        reach = np.stack([intrinsics.fx * radius / near, intrinsics.fy * radius / near], axis=-1) + 1
        shift = np.abs(middle - [intrinsics.cx, intrinsics.cy]) * (radius / near)[:, None]
        low = np.floor((middle - reach - shift).min(axis=0)).astype(int)
        high = np.ceil((middle + reach + shift).max(axis=0)).astype(int) + 1
        left, right = np.clip([low[0], high[0]], 0, intrinsics.width)
        top, bottom = np.clip([low[1], high[1]], 0, intrinsics.height)
        return slice(int(top), int(bottom)), slice(int(left), int(right))


def _pose(data: mujoco.MjData, body: int) -> FloatArray:
    """Pose (4, 4) of a body in the world."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return T
