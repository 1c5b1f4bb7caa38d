"""Small surfaces and the bytes of mesh files of them, sound or damaged, without any library for meshes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from mpgrasp.geometry import FloatArray


class Surface(NamedTuple):
    """A surface of triangles."""

    vertices: FloatArray
    """(n, 3) [m]"""
    faces: np.ndarray
    """(m, 3) indices of vertices, counter-clockwise from outside."""

    def moved(self, x: float, y: float = 0.0, z: float = 0.0) -> Surface:
        """Return it moved [m]."""
        return Surface(np.add(self.vertices, (x, y, z)), self.faces)

    def scaled(self, factor: float) -> Surface:
        """Return it larger by a factor, about the origin."""
        return Surface(self.vertices * factor, self.faces)

    def turned_out(self) -> Surface:
        """Return it inside out."""
        return Surface(self.vertices, self.faces[:, ::-1])

    def without(self, *faces: int) -> Surface:
        """Return it without some faces."""
        return Surface(self.vertices, np.delete(self.faces, faces, axis=0))

    def with_vertex(self, value: float) -> Surface:
        """Return it with a coordinate of one vertex replaced."""
        vertices = self.vertices.copy()
        vertices[0, 0] = value
        return Surface(vertices, self.faces)


def box(x: float = 0.03, y: float = 0.03, z: float = 0.03) -> Surface:
    """Return a box with these edges [m] about the origin; the last two faces are its lid."""
    corners = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * [x, y, z] / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Surface(corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))


def ball(radius: float, rows: int = 12) -> Surface:
    """Return a closed ball of latitudes and longitudes, 4 x rows^2 faces."""
    polar = np.linspace(0, np.pi, rows + 1)[1:-1]
    round_ = np.arange(2 * rows) * np.pi / rows
    ring = np.column_stack([np.cos(round_), np.sin(round_)])
    rings = [np.column_stack([np.sin(t) * ring, np.full(len(ring), np.cos(t))]) for t in polar]
    vertices = np.vstack([*rings, [(0, 0, 1)], [(0, 0, -1)]])
    n, faces = len(ring), []
    for r in range(len(polar)):
        for k in range(n):
            a, b = r * n + k, r * n + (k + 1) % n
            if r == 0:
                faces.append((len(vertices) - 2, a, b))
            if r == len(polar) - 1:
                faces.append((len(vertices) - 1, b, a))
            else:
                faces += [(a, a + n, b + n), (a, b + n, b)]
    return Surface(radius * vertices, np.array(faces))


def strip(half_turns: int, radius: float = 0.03, width: float = 0.02, n: int = 40) -> Surface:
    """Return a ring of tape, with a half turn a Moebius strip: no surface that encloses anything."""
    t = np.arange(n) * 2 * np.pi / n
    twist = t * half_turns / 2
    sides = []
    for side in (-width / 2, width / 2):
        reach = radius + side * np.cos(twist)
        sides.append(np.column_stack([reach * np.cos(t), reach * np.sin(t), side * np.sin(twist)]))
    faces = []
    for k in range(n):
        a, b, c, d = k, (k + 1) % n, k + n, (k + 1) % n + n
        if k == n - 1 and half_turns % 2:
            b, d = d, b
        faces += [(a, b, d), (a, d, c)]
    return Surface(np.vstack(sides), np.array(faces))


def together(*surfaces: Surface) -> Surface:
    """Return several surfaces as one."""
    ends = np.cumsum([0, *(len(s.vertices) for s in surfaces)])
    faces = [s.faces + start for s, start in zip(surfaces, ends, strict=False)]
    return Surface(np.vstack([s.vertices for s in surfaces]), np.vstack(faces))


def stl(surface: Surface, count: int | None = None) -> bytes:
    """Return a binary STL; `count` is the number of faces that it claims to have."""
    corners = surface.vertices[surface.faces].astype("<f4")
    records = b"".join(bytes(12) + triangle.tobytes() + bytes(2) for triangle in corners)
    return bytes(80) + struct.pack("<I", len(corners) if count is None else count) + records


def text_stl(surface: Surface, written: Callable[[float], object] = repr, end: str = "endsolid x\n") -> bytes:
    """Return a text STL."""
    lines = ["solid x"]
    for triangle in surface.vertices[surface.faces]:
        rows = [f"vertex {' '.join(str(written(float(v))) for v in corner)}" for corner in triangle]
        lines += ["facet normal 0 0 0", "outer loop", *rows, "endloop", "endfacet"]
    return ("\n".join(lines) + "\n" + end).encode()


def obj(surface: Surface, first: int = 1) -> bytes:
    """Return an OBJ; `first` is what it calls its first vertex."""
    vertices = [f"v {x!r} {y!r} {z!r}" for x, y, z in surface.vertices.tolist()]
    faces = [f"f {a + first} {b + first} {c + first}" for a, b, c in surface.faces.tolist()]
    return "\n".join([*vertices, *faces, ""]).encode()


def ply(
    surface: Surface, vertices: int | None = None, faces: int | None = None, form: str = "ascii 1.0"
) -> bytes:
    """Return a PLY; `vertices` and `faces` are the numbers of them that it claims to have."""
    return ply_header(surface, vertices, faces, form) + ply_body(surface, form)


def ply_header(surface: Surface, vertices: int | None, faces: int | None, form: str) -> bytes:
    """Return the header of a PLY."""
    n = len(surface.vertices) if vertices is None else vertices
    m = len(surface.faces) if faces is None else faces
    axes = [f"property double {axis}" for axis in "xyz"]
    rows = ["ply", f"format {form}", f"element vertex {n}", *axes, f"element face {m}"]
    return "\n".join([*rows, "property list uchar int vertex_indices", "end_header", ""]).encode()


def ply_body(surface: Surface, form: str) -> bytes:
    """Return what follows the header of a PLY."""
    if form.startswith("binary"):
        faces = b"".join(struct.pack("<B3i", 3, *face) for face in surface.faces.tolist())
        return surface.vertices.astype("<f8").tobytes() + faces
    rows: list[Sequence[object]] = [*surface.vertices.tolist(), *([3, *f] for f in surface.faces.tolist())]
    return "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
