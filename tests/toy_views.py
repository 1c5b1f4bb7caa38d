"""A world without physics: a blob of grasp quality on a flat table, seen by a camera that flies freely."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mpgrasp.controllers.controller import Command, Controller, Observation
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import GraspMap

# 350 of 480 rows of a D435, resized to 224
INTRINSICS = CameraIntrinsics(fx=385 * 0.64, fy=385 * 0.64, cx=111.5, cy=111.5, width=224, height=224)
# the camera sits 7 cm in front of the hand and 6.3 cm above the tool point; image x = hand y
T_TCP_CAMERA = np.array([[0, -1, 0, 0.07], [1, 0, 0, 0], [0, 0, 1, -0.063], [0, 0, 0, 1.0]])


@dataclass(frozen=True, kw_only=True)
class Blob:
    """A grasp at world (x, y) on the table, the quality of which falls off as a Gaussian."""

    x: float
    y: float
    angle: float = 0.5
    width: float = 0.04
    radius: float = 0.012
    quality: Callable[[float], float] = lambda height: 0.9
    """Peak quality as a function of the camera's height: thin things are seen from near by only."""


def flat_map(
    quality: float,
    T_world_camera: FloatArray,
    intrinsics: CameraIntrinsics = INTRINSICS,
    *,
    surface: float = 0.0,
) -> GraspMap:
    """The same quality everywhere on a table at height `surface` [m]."""
    shape = (intrinsics.height, intrinsics.width)
    return GraspMap(
        quality=np.full(shape, quality, np.float32),
        angle=np.zeros(shape, np.float32),
        width=np.full(shape, 20.0, np.float32),
        depth=np.full(shape, T_world_camera[2, 3] - surface, np.float32),
        intrinsics=intrinsics,
        T_world_camera=T_world_camera,
    )


def blob_map(
    blob: Blob, T_world_camera: FloatArray, rng: np.random.Generator | None, *, noise: float = 0.03
) -> GraspMap:
    """Return a detector's map of the blob, worked out here without any of mpgrasp's own geometry."""
    T, k = T_world_camera, INTRINSICS
    height = float(T[2, 3])
    a = (np.arange(k.width) - k.cx) / k.fx * height
    b = ((np.arange(k.height) - k.cy) / k.fy * height)[:, None]
    x, y = T[0, 3] + T[0, 0] * a + T[0, 1] * b, T[1, 3] + T[1, 0] * a + T[1, 1] * b
    squared = (x - blob.x) ** 2 + (y - blob.y) ** 2
    quality = blob.quality(height) * np.exp(-0.5 * squared / blob.radius**2)
    if rng is not None:
        quality = quality + np.abs(noise * rng.standard_normal(quality.shape))
    shape = quality.shape
    heading_of_image_x = np.arctan2(T[1, 0], T[0, 0])
    return GraspMap(
        quality=np.clip(quality, 0, 1).astype(np.float32),
        angle=np.full(shape, blob.angle - heading_of_image_x, np.float32),
        width=np.full(shape, blob.width / height * k.fx, np.float32),
        depth=np.full(shape, height, np.float32),
        intrinsics=k,
        T_world_camera=T,
    )


@dataclass(frozen=True)
class Flight:
    """Record of a reach: camera xy (n, 2), commands, and the last tcp pose."""

    camera: FloatArray
    commands: list[Command]
    T_world_tcp: FloatArray


def fly(
    controller: Controller,
    blob: Blob,
    *,
    seed: int = 0,
    start: tuple[float, float] = (0.43, 0.0),
    noise: float = 0.03,
    dt: float = 0.1,
) -> Flight:
    """Reset the controller, then follow its commands exactly until it is done (at most 20 s)."""
    rng = np.random.default_rng(seed)
    controller.reset(seed)
    position, yaw = np.array([*start, 0.50]), 0.0
    camera, commands = [], []
    for tick in range(round(20 / dt)):
        T_world_tcp = looking_down(position, yaw)
        T_world_camera = T_world_tcp @ T_TCP_CAMERA
        camera.append(T_world_camera[:2, 3])
        view = blob_map(blob, T_world_camera, rng, noise=noise)
        command = controller.update(Observation(time=tick * dt, T_world_tcp=T_world_tcp, grasp_map=view))
        commands.append(command)
        if command.done:
            break
        position = position + command.twist[:3] * dt
        yaw += command.twist[5] * dt
    return Flight(np.array(camera), commands, T_world_tcp)
