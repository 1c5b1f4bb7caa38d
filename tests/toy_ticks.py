"""Single control ticks of a camera over a blob of grasp quality, or over none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from toy_views import T_TCP_CAMERA, Blob, blob_map, flat_map

from mpgrasp.controllers.controller import Command, Observation
from mpgrasp.geometry import looking_down
from mpgrasp.grasp import GraspMap

REACHING = ["mppc", "mvp", "mppc_robust", "mvp_robust"]
ROBUST = ["mppc_robust", "mvp_robust"]
OBJECT = Blob(x=0.55, y=0.08)
NOTHING = Blob(x=0.5, y=0.0, quality=lambda height: 0.0)
THIN = Blob(x=0.53, y=0.05, quality=lambda height: 0.8 if height < 0.42 else 0.0)


def observe(
    position: tuple[float, float, float], view: Blob | GraspMap | float = OBJECT, yaw: float = 0.0
) -> Observation:
    """A tick at a tcp position: of a blob, of the same quality everywhere, or with the maps of `view`."""
    T_world_tcp = looking_down(position, yaw)
    T_world_camera = T_world_tcp @ T_TCP_CAMERA
    if isinstance(view, Blob):
        seen = blob_map(view, T_world_camera, None)
    elif isinstance(view, GraspMap):
        seen = replace(view, T_world_camera=T_world_camera)
    else:
        seen = flat_map(view, T_world_camera)
    return Observation(time=0.0, T_world_tcp=T_world_tcp, grasp_map=seen)


def blind_map() -> GraspMap:
    view = flat_map(0.0, looking_down([0.5, 0.0, 0.5]))
    return replace(view, depth=np.full_like(view.depth, np.nan))


def same(a: Command, b: Command) -> bool:
    return bool(np.array_equal(a.twist, b.twist)) and a.gripper == b.gripper and a.done == b.done
