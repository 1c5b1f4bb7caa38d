"""Closed surfaces from mesh files: read, checked for size, mended where little is missing, simplified."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from mpgrasp.exceptions import AssetError
from mpgrasp.scene.objects.model import MAX_SIZE

MESH_TYPES = (".glb", ".obj", ".ply", ".stl")
"""Endings of the files that are read, in lower case."""
MIN_SIZE = 0.01
"""Least longest edge of an object's bounding box [m]; below, the units are wrong or a camera sees nothing."""
MAX_PATCH = 0.02
"""Share of a mesh's surface that may be missing: holes of a scan are closed, an open box stays refused."""
NEGLIGIBLE = 1e-3
"""A loose piece with less than this share of the mesh's surface, and next to no faces, is a flaw."""


def load_surface(content: bytes, suffix: str, scale: float = 1.0) -> Any:
    """The whole surface of a file in metres as one `trimesh.Trimesh`.

    Args:
        content: of the file.
        suffix: its type, as in `MESH_TYPES`.
        scale: unit of the file [m].

    Raises:
        AssetError: unreadable, empty or of an implausible size.
    """
    import trimesh

    if suffix not in MESH_TYPES:
        raise AssetError("unknown type of file", got=suffix, allowed=MESH_TYPES)
    empty = AssetError("mesh is empty", allowed="at least 4 vertices and their faces")
    if not content.strip():
        raise empty
    _CHECKS[suffix](content)
    if suffix in (".obj", ".ply"):
        content = _as_utf8(content, suffix)
    try:
        # as it is: a vertex that is no number would be left out, and a mesh that is far too small be a point
        loaded = trimesh.load(io.BytesIO(content), file_type=suffix[1:], force="mesh", process=False)
    except Exception as error:  # each file type fails in its own way
        what = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise AssetError(f"unreadable {suffix[1:].upper()} file ({what})") from None
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0 or len(loaded.vertices) < 4:
        raise empty
    n = len(loaded.vertices)
    if loaded.faces.min() < (-n if suffix == ".obj" else 0) or loaded.faces.max() >= n:  # OBJ counts back too
        raise AssetError("mesh has faces between vertices that it does not have")
    vertices = loaded.vertices if scale == 1 else np.asarray(loaded.vertices, float) * scale
    if suffix == ".glb":  # whose y axis points up
        vertices = np.asarray(vertices)[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
    corners = np.asarray(vertices, float)[loaded.faces].reshape(-1, 3)
    if not np.isfinite(corners).all():
        raise AssetError("mesh has vertices that are not numbers")
    _check_size(float(np.ptp(corners, axis=0).max()))
    # a new mesh without texture: where colour or normals change, files have each vertex twice
    mesh = trimesh.Trimesh(vertices, loaded.faces, process=True)
    a, b, c = mesh.faces.T
    mesh.update_faces((a != b) & (b != c) & (c != a))
    if len(mesh.faces) == 0:
        raise empty
    return mesh


def _check_stl(content: bytes) -> None:
    """Raise AssetError unless the content has the length that a binary STL says it has, or is a text one."""
    faces = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 and len(content) == 84 + 50 * faces:
        return
    if content.lstrip()[:5].lower() == b"solid" and b"\0" not in content:
        if b"endsolid" in content.lower():
            return
        raise AssetError("text STL without its end", allowed="the whole file, up to endsolid")
    raise AssetError(
        "binary STL is cut off or too long",
        got=f"{len(content)} bytes",
        allowed=f"84 + 50 x {faces} = {84 + 50 * faces} by its own count of faces",
    )


def _check_obj(content: bytes) -> None:
    """Raise AssetError for a face of vertex 0, which would be taken for the last, or a vertex in a plane."""
    if re.search(rb"^[ \t]*f[ \t](?:.*[ \t])?0+(?:/|\s|$)", content, re.MULTILINE):
        raise AssetError("OBJ has a face of vertex 0", allowed="1 for the first vertex, -1 for the last")
    if re.search(rb"^[ \t]*v(?:[ \t]+\S+){0,2}[ \t]*\r?$", content, re.MULTILINE):
        raise AssetError("OBJ has a vertex without three coordinates")


def _check_ply(content: bytes) -> None:
    """Raise AssetError for a text PLY with fewer lines than its header says, of which the rest is cut off."""
    head, found, body = content.partition(b"end_header")
    if not content.startswith(b"ply") or not found:
        raise AssetError("PLY without its header", allowed="a file that begins with ply, up to end_header")
    counts = [int(count) for count in re.findall(rb"^element[ \t]+\S+[ \t]+(\d+)", head, re.MULTILINE)]
    lines = len(body.split(b"\n", 1)[-1].strip().splitlines())
    if b"format ascii" in head and lines < sum(counts):
        raise AssetError(
            "text PLY is cut off", got=f"{lines} lines", allowed=f"{sum(counts)}, as its header says"
        )


def _check_glb(content: bytes) -> None:
    """Raise AssetError unless the content is a whole glTF 2 file that needs no other."""
    if content[:4] != b"glTF" or len(content) < 20:
        raise AssetError("GLB without its header", allowed="a binary glTF file")
    version, length = (int.from_bytes(content[at : at + 4], "little") for at in (4, 8))
    if version != 2:
        raise AssetError("GLB of another version", got=version, allowed="glTF 2")
    if length != len(content):
        raise AssetError("GLB is cut off or too long", got=f"{len(content)} bytes", allowed=str(length))


def _as_utf8(content: bytes, suffix: str) -> bytes:
    """Return the content of a text file in UTF-8, comments and names in Latin-1 included."""
    end = content.find(b"end_header") if suffix == ".ply" else -1
    head, rest = (content[:end], content[end:]) if end >= 0 else (content, b"")
    try:
        head.decode("utf-8")
    except UnicodeDecodeError:
        head = head.decode("latin-1").encode("utf-8")
    return head + rest


_CHECKS: dict[str, Callable[[bytes], None]] = {
    ".glb": _check_glb, ".obj": _check_obj, ".ply": _check_ply, ".stl": _check_stl,
}  # fmt: skip
"""What a reader of files would not notice, by type."""


def _check_size(edge: float) -> None:
    allowed = f"a longest edge of {MIN_SIZE} to {MAX_SIZE} m"
    if edge >= 1:
        raise AssetError(
            "mesh is too large [m]",
            got=round(edge, 3),
            allowed=f"{allowed}; is the file in millimetres? --scale 0.001",
        )
    if edge > MAX_SIZE:
        raise AssetError("mesh is too large [m]", got=round(edge, 3), allowed=allowed)
    if edge < MIN_SIZE:
        hint = "was it converted from millimetres twice?"
        raise AssetError("mesh is too small [m]", got=float(f"{edge:.2g}"), allowed=f"{allowed}; {hint}")


def closed_shells(mesh: Any) -> list[Any]:
    """The mesh's connected pieces, closed and consistently wound; flaws of the file left out.

    Raises:
        AssetError: more is missing than may be made up for, or nothing encloses a volume.
    """
    import trimesh

    repair: Any = trimesh.repair
    shells, missing, total = [], 0.0, float(mesh.area)
    for shell in mesh.split(only_watertight=False, repair=False):
        if len(shell.faces) < 4 and shell.area < NEGLIGIBLE * total:
            continue  # slivers that decimation leaves behind
        if not shell.is_winding_consistent:
            repair.fix_winding(shell)
        if not shell.is_watertight:
            area = shell.area
            repair.fill_holes(shell, use_fan=True)
            missing += float(shell.area - area)
        if not shell.is_watertight:
            raise AssetError("mesh is not closed, and cannot be", allowed="a surface without holes")
        if abs(shell.volume) > 1e-12:
            shells.append(shell)
    if missing > MAX_PATCH * total:
        raise AssetError(
            "mesh is not closed",
            got=f"holes of {missing / total:.0%} of its surface",
            allowed=f"up to {MAX_PATCH:.0%}, which are closed, or a closed surface",
        )
    if not shells:
        raise AssetError("mesh is flat", allowed="a surface that encloses a volume")
    return shells


def simplified(solid: Any, faces: int) -> Any:
    """The closed surface with about so many faces; as it is where it would not stay closed."""
    simple = _unpinched(solid.simplify_quadric_decimation(face_count=faces, aggression=3))
    same = abs(simple.volume - solid.volume) < MAX_PATCH * solid.volume
    return simple if simple.is_volume and same else solid


def _unpinched(mesh: Any) -> Any:
    """The same surface with two faces at every edge.

    Simplifying lets thin walls touch, so that four faces meet in an edge. There each pair of faces gets a
    midpoint of its own; faces that lie back to back are taken away.
    """
    import trimesh

    vertices = list(np.asarray(mesh.vertices))
    _, which, count = np.unique(np.sort(mesh.faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    faces = [tuple(map(int, face)) for face in mesh.faces[count[which.ravel()] != 2]]
    faces = [face for face in faces if len(set(face)) == 3]
    while pinched := {edge: meeting for edge, meeting in _around_edges(faces).items() if len(meeting) > 2}:
        done: set[int] = set()
        for (p, q), meeting in pinched.items():
            ahead, back = ([k for k, forward in meeting if forward is way] for way in (True, False))
            if len(ahead) != len(back):
                return mesh  # an open surface
            if done.intersection([*ahead, *back]):
                continue  # such a face has another pinched edge and was cut there: the next round's
            done.update(ahead, back)
            for pair in zip(ahead, back, strict=True):
                middle = len(vertices)
                vertices.append((vertices[p] + vertices[q]) / 2)
                for k in pair:
                    a, b, c = faces[k]
                    while {a, b} != {p, q}:
                        a, b, c = b, c, a
                    faces[k] = (a, middle, c)
                    faces.append((middle, b, c))
    return trimesh.Trimesh(vertices, faces, process=False)


def _around_edges(faces: list[tuple[int, ...]]) -> dict[tuple[int, int], list[tuple[int, bool]]]:
    """Faces at every edge (lower vertex, higher vertex), each with True if it runs from lower to higher."""
    around: dict[tuple[int, int], list[tuple[int, bool]]] = {}
    for k, (a, b, c) in enumerate(faces):
        for p, q in ((a, b), (b, c), (c, a)):
            around.setdefault((min(p, q), max(p, q)), []).append((k, p < q))
    return around
