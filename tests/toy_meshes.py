"""Small meshes with known flaws, and files of them, for the tests of mesh files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

trimesh = pytest.importorskip("trimesh")

EDGES = (0.04, 0.05, 0.06)
"""Edges of a box [m]."""


def write(mesh: Any, path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.export(path)
    return path


def box(path: Path, edges: tuple[float, float, float] = EDGES) -> Path:
    return write(trimesh.creation.box(edges), path)


def u_shape() -> Any:
    """A U of 60 x 40 mm, 20 mm deep, whose slot is 30 mm wide and 25 mm high."""
    outline = np.array([(0, 0), (60, 0), (60, 40), (45, 40), (45, 15), (15, 15), (15, 40), (0, 40)]) / 1000
    quads = [(0, 5, 6, 7), (0, 1, 4, 5), (1, 2, 3, 4)]
    n = len(outline)
    vertices = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (0.0, 0.02)])
    faces = []
    for a, b, c, d in quads:
        faces += [(c, b, a), (d, c, a), (n + a, n + b, n + c), (n + a, n + c, n + d)]
    for k in range(n):
        j = (k + 1) % n
        faces += [(k, j, n + j), (k, n + j, n + k)]
    return trimesh.Trimesh(vertices, faces)


def open_box() -> Any:
    mesh = trimesh.creation.box(EDGES)
    mesh.update_faces(mesh.face_normals[:, 2] < 0.5)
    return mesh


def half_ball() -> Any:
    mesh = trimesh.creation.icosphere(radius=0.03)
    mesh.update_faces(mesh.triangles_center[:, 2] > 0)
    return mesh
