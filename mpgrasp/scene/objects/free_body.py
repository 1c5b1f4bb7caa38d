"""An object in a MuJoCo model: a free body with one geom for each of its parts."""

from __future__ import annotations

import mujoco
from numpy.typing import ArrayLike

from mpgrasp.scene.objects.model import OBJECT_GROUP, ObjectModel

SOLREF = (0.004, 1.0)
"""Time constant [s] (the least that 2 ms steps allow) and damping ratio of an object's contacts."""
SOLIMP = (0.99, 0.999, 0.0005, 0.5, 2.0)
"""Soft contacts give in proportion to force over mass: 40 N on 10 g would sink 3 mm at the usual 0.95."""
TORSIONAL_FRICTION = 0.003
"""Moment of friction about the contact normal per unit of normal force [m]: a soft pad's patch."""
ROLLING_FRICTION = 0.0008
"""Moment of friction against rolling per unit of normal force [m]: cloth gives way under a round thing."""

_ROUND = ("cylinder", "capsule", "ellipsoid")
_GEOM_TYPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    "mesh": mujoco.mjtGeom.mjGEOM_MESH,
}


def add_object(
    spec: mujoco.MjSpec,
    model: ObjectModel,
    position: ArrayLike = (0.0, 0.0, 0.0),
    quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    *,
    name: str | None = None,
) -> mujoco.MjsBody:
    """Add the object to a model being built, as a free body called `name` (default: its own name).

    The contacts of its geoms are the object's own (priority 1), whatever it touches.
    """
    name = name or model.name
    body = spec.worldbody.add_body(name=name, pos=position, quat=quaternion)
    body.add_freejoint(name=f"{name}/free")
    for k, part in enumerate(model.parts):
        rolls = model.rolls or part.shape in _ROUND
        geom = body.add_geom(
            name=f"{name}/{k}",
            type=_GEOM_TYPES[part.shape],
            pos=part.position,
            quat=part.quaternion,
            mass=model.mass * part.volume / model.volume,
            friction=[model.friction, TORSIONAL_FRICTION, ROLLING_FRICTION],
            condim=6 if rolls else 4,
            priority=1,
            solref=list(SOLREF),
            solimp=list(SOLIMP),
            group=OBJECT_GROUP,
            rgba=list(model.rgba),
        )
        if part.shape == "mesh":
            assert part.vertices is not None
            spec.add_mesh(
                name=f"{name}/{k}",
                uservert=part.vertices.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
            )
            geom.meshname = f"{name}/{k}"
        else:
            geom.size[: len(part.size)] = part.size
    return body
