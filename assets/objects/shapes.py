"""Convex pieces from dimensions in millimetres, of which the objects of the catalogue consist."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coacd
import numpy as np
import trimesh
from scipy.spatial import ConvexHull

from mpgrasp.scene.objects.from_mesh import CONVEX_ENOUGH, MAX_PIECES
from mpgrasp.scene.objects.model import Part

MM = 1e-3
WHOLE = 12
"""Wedges that a full ring is cut into."""


@dataclass(frozen=True)
class Declared:
    """One object before it is written."""

    parts: list[Part]
    grams: float
    friction: float
    rgba: tuple[float, float, float]
    provenance: str
    rolls: bool = False


def box(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0), yaw: float = 0.0) -> Part:
    """Box of full edges x, y, z about `at`, turned by `yaw` [rad]."""
    return Part(
        shape="box",
        size=(x / 2 * MM, y / 2 * MM, z / 2 * MM),
        position=_m(at),
        quaternion=(float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))),
    )


def rod(
    shape: str, radius: float, length: float, at: tuple[float, float, float] = (0, 0, 0), axis: str = "z"
) -> Part:
    """Cylinder or capsule about `at`; `length` without a capsule's caps."""
    h = float(np.sqrt(0.5))
    turn = {"z": (1.0, 0.0, 0.0, 0.0), "x": (h, 0.0, h, 0.0), "y": (h, h, 0.0, 0.0)}[axis]
    return Part(shape=shape, size=(radius * MM, length / 2 * MM), position=_m(at), quaternion=turn)


def hull(points: object) -> Part:
    """Convex hull of points [mm]."""
    points = np.asarray(points, float)
    return Part(shape="mesh", vertices=points[ConvexHull(points).vertices] * MM)


def frustum(radius_low: float, radius_high: float, low: float, high: float, sides: int = 24) -> Part:
    """Upright cone frustum between two heights."""
    a = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(a), np.sin(a), np.zeros(sides)])
    return hull(
        np.vstack(
            [
                ring * (radius_low, radius_low, 0) + (0, 0, low),
                ring * (radius_high, radius_high, 0) + (0, 0, high),
            ]
        )
    )


def ring(
    inner: tuple[float, float], outer: tuple[float, float], low: float, high: float, n: int = WHOLE
) -> list[Part]:
    """Wedges around z; inner and outer radius at the lower and at the upper edge."""
    pieces = []
    for k in range(n):
        corners = []
        for a in np.linspace(k, k + 1, 3) * 2 * np.pi / n:
            for z, r_in, r_out in ((low, inner[0], outer[0]), (high, inner[1], outer[1])):
                corners += [
                    (r_in * np.cos(a), r_in * np.sin(a), z),
                    (r_out * np.cos(a), r_out * np.sin(a), z),
                ]
        pieces.append(hull(corners))
    return pieces


def loft(sections: list[tuple[float, list[tuple[float, float]]]]) -> Part:
    """Hull of cross-sections: (x, [(y, z) ...]), mirrored in y."""
    return hull([(x, side * y, z) for x, outline in sections for y, z in outline for side in (-1, 1)])


def extruded(outline: Sequence[tuple[float, float]], thickness: float) -> list[Part]:
    """Board cut along a closed outline in x and z, counter-clockwise, taken apart by CoACD."""
    points = np.array(outline, float)
    mesh = trimesh.creation.extrude_triangulation(points, _ears(points), thickness)
    mesh.vertices = mesh.vertices[:, [0, 2, 1]] - (0, thickness / 2, 0)
    mesh.faces = mesh.faces[:, ::-1]
    return _cut(mesh)


def tube(centres: np.ndarray, radii: np.ndarray, sides: int = 16) -> list[Part]:
    """Tube in the xy plane along centres (n, 2) with radii (n,), closed, taken apart by CoACD."""
    tangent = np.gradient(centres, axis=0)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]]) / np.linalg.norm(tangent, axis=1, keepdims=True)
    a = 2 * np.pi * np.arange(sides) / sides
    rings = [
        np.column_stack([c[0] + r * np.cos(a) * n[0], c[1] + r * np.cos(a) * n[1], r * np.sin(a)])
        for c, n, r in zip(centres, normal, radii, strict=True)
    ]
    vertices = np.vstack([*rings, [*centres[0], 0.0], [*centres[-1], 0.0]])
    count, first, last = len(centres), len(vertices) - 2, len(vertices) - 1
    faces = []
    for j in range(sides):
        k = (j + 1) % sides
        for i in range(count - 1):
            p, q, r, s = i * sides + j, i * sides + k, (i + 1) * sides + j, (i + 1) * sides + k
            faces += [(p, q, r), (q, s, r)]
        faces += [(first, k, j), (last, (count - 1) * sides + j, (count - 1) * sides + k)]
    return _cut(trimesh.Trimesh(vertices, faces))


def _cut(mesh: trimesh.Trimesh) -> list[Part]:
    """Convex pieces of a closed surface, by CoACD where it is not convex."""
    if mesh.volume < 0:
        mesh.invert()
    assert mesh.is_volume
    whole = mesh.convex_hull
    if mesh.volume >= CONVEX_ENOUGH * whole.volume:
        return [hull(whole.vertices)]
    coacd.set_log_level("error")
    cut = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=0.05,
        max_convex_hull=MAX_PIECES,
        resolution=1000,
        seed=0,
    )
    return [hull(vertices) for vertices, _ in cut]


def _ears(points: np.ndarray) -> np.ndarray:
    """Triangles (n - 2, 3) of a simple polygon, by cutting off ears."""

    def cross(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
        return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    left, triangles = list(range(len(points))), []
    while len(left) > 3:
        for k in range(len(left)):
            i, j, m = left[k - 1], left[k], left[(k + 1) % len(left)]
            a, b, c = points[i], points[j], points[m]
            others = [points[o] for o in left if o not in (i, j, m)]
            if cross(a, b, c) > 0 and not any(
                cross(a, b, p) >= 0 and cross(b, c, p) >= 0 and cross(c, a, p) >= 0 for p in others
            ):
                triangles.append((i, j, m))
                left.pop(k)
                break
        else:
            raise ValueError("outline is not a simple counter-clockwise polygon")
    return np.array([*triangles, tuple(left)])


def _m(at: tuple[float, float, float]) -> tuple[float, float, float]:
    return at[0] * MM, at[1] * MM, at[2] * MM
