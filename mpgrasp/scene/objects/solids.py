"""Solids of one mesh, each as convex pieces: whether they hang together, and the space that they share."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from mpgrasp.exceptions import AssetError
from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import product

MAX_GAP = 0.001
"""Widest gap between two solids that count as one body [m]: parts of a drawing that nearly touch."""
_POINTS = 2**15  # of the box around all solids, at which their union is counted

Solid = Sequence[FloatArray]
"""Convex pieces, each the hull of vertices (n, 3) [m]."""


def require_together(solids: Sequence[Solid]) -> None:
    """Raise AssetError unless solids hang together, each within `MAX_GAP` of the others."""
    apart = gaps(solids)
    group = list(range(len(solids)))
    for (i, j), gap in apart.items():
        if gap <= MAX_GAP:
            old, new = group[j], group[i]
            group = [new if k == old else k for k in group]
    if len(set(group)) > 1:
        nearest = min(gap for (i, j), gap in apart.items() if group[i] != group[j])
        raise AssetError(
            "mesh is of several bodies apart",
            got=f"{len(set(group))} bodies, {1000 * nearest:.1f} mm or more from one another",
            allowed=f"one body, or gaps of up to {1000 * MAX_GAP:g} mm; save each as a file of its own",
        )


def gaps(solids: Sequence[Solid]) -> dict[tuple[int, int], float]:
    """Return the distance of each two solids [m]; negative where they lie in one another."""
    if len(solids) < 2:
        return {}
    import mujoco

    spec = mujoco.MjSpec()
    geoms: list[list[int]] = []
    for k, solid in enumerate(solids):
        geoms.append([])
        for piece in solid:
            name = f"{k}/{len(geoms[k])}"
            spec.add_mesh(
                name=name, uservert=piece.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
            )
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, name=name)
            geoms[k].append(sum(map(len, geoms)))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return {
        (i, j): min(mujoco.mj_geomDistance(model, data, a, b, 1.0, None) for a in geoms[i] for b in geoms[j])
        for i, j in combinations(range(len(solids)), 2)
    }


def share_of_union(solids: Sequence[Solid]) -> float:
    """Return the volume of the union of solids over the sum of their volumes; 1 where none shares space.

    It is counted at points that fill the box around them evenly (a Sobol sequence), to about 1 %.
    """
    if len(solids) < 2:
        return 1.0
    from scipy.stats import qmc

    every = np.vstack([piece for solid in solids for piece in solid])
    low, high = every.min(axis=0), every.max(axis=0)
    points = low + (high - low) * qmc.Sobol(3, scramble=True, rng=0).random(_POINTS)
    inside = np.array([_contains(solid, points) for solid in solids])  # (n, points)
    return float(inside.any(axis=0).sum() / inside.sum())


def _contains(solid: Solid, points: FloatArray) -> FloatArray:
    from scipy.spatial import ConvexHull  # takes long to import, and few objects need it

    found = np.zeros(len(points), bool)
    for piece in solid:
        planes = ConvexHull(piece).equations  # (m, 4)
        found |= (product(points, planes[:, :3].T) + planes[:, 3] <= 0).all(axis=1)
    return found
