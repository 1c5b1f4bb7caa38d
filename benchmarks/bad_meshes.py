"""Mesh files that must be refused: no meshes at all, damaged, of no possible size, or enclosing nothing.

Each is made from a sound mesh by one change. Tests read them all; so can a study.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mesh_writers import Surface, ball, box, obj, ply, ply_body, ply_header, stl, strip, text_stl, together


@dataclass(frozen=True, kw_only=True)
class BadMesh:
    """One such file."""

    make: Callable[[Path], object]
    """Makes the file at a path."""
    said: str
    """Regular expression that the reason matches."""
    suffix: str = ".stl"
    dropped: bool = False
    """True if it has to be dropped on a table before anything is seen to be wrong with it."""

    def write(self, folder: Path) -> Path:
        """Make the file in a folder, and return its path."""
        path = folder / f"bad{self.suffix}"
        self.make(path)
        return path


def _raw(said: str, content: bytes, suffix: str = ".stl", *, dropped: bool = False) -> BadMesh:
    return BadMesh(make=lambda path: path.write_bytes(content), said=said, suffix=suffix, dropped=dropped)


def _stl(said: str, surface: Surface, *, dropped: bool = False) -> BadMesh:
    return _raw(said, stl(surface), dropped=dropped)


def _large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(300_000_000)  # a hole: it takes no room on the disk


def _said_of_none(suffix: str, content: bytes) -> str:
    """Return what is said of a file that is none of its type."""
    if not content.strip() or suffix == ".obj":
        return _EMPTY
    if suffix == ".glb":
        return "GLB without its header"
    return _HEADER if suffix == ".ply" else _CUT.format(len(content))


_BOX = box()
_TYPES = (".stl", ".obj", ".ply")
_EMPTY = "mesh is empty; allowed: at least 4 vertices"
_CUT = "binary STL is cut off or too long; got '{} bytes'; allowed: 84 \\+ 50 x"
_HEADER = "PLY without its header; allowed: a file that begins with ply"
_SHORT = "text PLY is cut off; got '{} lines'; allowed: {}"
_NUMBERS = "mesh has vertices that are not numbers"
_ABSENT = "mesh has faces between vertices that it does not have"
_HOLES = "mesh is not closed; got 'holes of {}% of its surface'; allowed: up to 2%"
_OPEN = "mesh is not closed, and cannot be"
_FLAT = "mesh is flat"
_GONE = "no such file or folder of objects"
_LARGE = r"mesh is too large \[m\]; got {}; allowed: a longest edge of 0.01 to 0.3 m"
_SMALL = r"mesh is too small \[m\]; got {}; allowed: a longest edge.*millimetres twice"
_APART = "mesh is of several bodies apart; got '{} bodies, {} mm or more"
_MANY = "mesh is of many bodies; got {}; allowed: up to 32"
_HAND = "the hand cannot close on it"
_NONE = {
    "empty": b"",
    "blank": b" \n\t\n",
    "zeros": bytes(4096),
    "prose": b"This is the mesh of a cup.\n" * 20,
    "noise": np.random.default_rng(0).bytes(4000),
    "png": b"\x89PNG\r\n\x1a\n" + bytes(500),
    "zip": b"PK\x03\x04" + bytes(500),
    "git-lfs": b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 684\n",
    "html": b"<!DOCTYPE html><html><body>404</body></html>\n",
    "utf-16": "v 0 0 0\nf 1 2 3\n".encode("utf-16"),
}
_CUT_PLY = ply(_BOX, form="binary_little_endian 1.0")
_QUAD = Surface(
    np.array([(0, 0, 0), (0.03, 0, 0), (0.03, 0.03, 0), (0, 0.03, 0)]), np.array([(0, 1, 2), (0, 2, 3)])
)
_ROW = [box(0.004, 0.02, 0.02).moved(0.0045 * k) for k in range(40)]
_DUST = [box(0.002, 0.002, 0.002).moved(0.004 * (k % 20), 0.004 * (k // 20)) for k in range(400)]

BAD_MESHES: dict[str, BadMesh] = {
    # files that are none
    **{
        f"{name}-{suffix[1:]}": _raw(_said_of_none(suffix, content), content, suffix)
        for name, content in _NONE.items()
        for suffix in _TYPES
    },
    # of no type that is read, or no file
    **{
        f"type-{suffix[1:]}": _raw("unknown type of file", stl(_BOX), suffix)
        for suffix in (".off", ".gltf", ".3mf", ".step", ".gz")
    },
    "no-type": _raw("unknown type of file", stl(_BOX), ""),
    "folder": BadMesh(make=Path.mkdir, said="it is a directory|no mesh in folder"),
    "pipe": BadMesh(make=os.mkfifo, said="a pipe or a device"),
    "endless": BadMesh(make=lambda path: path.symlink_to("/dev/zero"), said="a pipe or a device"),
    "null": BadMesh(make=lambda path: path.symlink_to("/dev/null"), said="a pipe or a device"),
    "circle": BadMesh(make=lambda path: path.symlink_to(path), said=_GONE),
    "dangling": BadMesh(make=lambda path: path.symlink_to("/nowhere"), said=_GONE),
    "huge": BadMesh(make=_large, said="more than 200 MB"),
    # GLB
    **{
        f"{name}-glb": _raw(_said_of_none(".glb", content), content, ".glb")
        for name, content in _NONE.items()
    },
    "glb-stl": _raw("GLB without its header", stl(_BOX), ".glb"),
    # STL
    "stl-half-header": _raw(_CUT.format(50), stl(_BOX)[:50]),
    "stl-header-alone": _raw(_CUT.format(84), stl(_BOX)[:84]),
    "stl-truncated": _raw(_CUT.format(300), stl(_BOX)[:300]),
    "stl-byte-short": _raw(_CUT.format(683), stl(_BOX)[:-1]),
    "stl-byte-long": _raw(_CUT.format(685), stl(_BOX) + b"\0"),
    "stl-no-faces": _raw(_CUT.format(684), stl(_BOX, 0)),
    "stl-4-billion-faces": _raw(_CUT.format(684), stl(_BOX, 2**32 - 1)),
    "stl-nan": _stl(_NUMBERS, _BOX.with_vertex(np.nan)),
    "stl-infinite": _stl(_NUMBERS, _BOX.with_vertex(np.inf)),
    "stl-no-end": _raw("text STL without its end", text_stl(_BOX, end="")),
    "stl-words": _raw("unreadable STL file", text_stl(_BOX, lambda _: "wide")),
    "stl-commas": _raw("unreadable STL file", text_stl(_BOX, lambda v: str(v).replace(".", ","))),
    "stl-text-nan": _raw(_NUMBERS, text_stl(_BOX, lambda _: "nan")),
    "stl-two-corners": _raw("unreadable STL file", text_stl(_BOX).replace(b"vertex", b"corner", 1)),
    # OBJ
    "obj-vertices-alone": _raw(_EMPTY, obj(_BOX._replace(faces=_BOX.faces[:0])), ".obj"),
    "obj-comments-alone": _raw(_EMPTY, b"# a cup\n# by nobody\n", ".obj"),
    "obj-lines-alone": _raw(_EMPTY, b"v 0 0 0\nv 1 0 0\nl 1 2\n", ".obj"),
    "obj-beyond": _raw("unreadable OBJ file.*out of bounds", obj(_BOX, 5), ".obj"),
    "obj-from-zero": _raw("OBJ has a face of vertex 0; allowed: 1 for the first", obj(_BOX, 0), ".obj"),
    "obj-far-back": _raw("unreadable OBJ file.*out of bounds", obj(_BOX) + b"f -99 -98 -97\n", ".obj"),
    "obj-nan": _raw(_NUMBERS, obj(_BOX.with_vertex(np.nan)), ".obj"),
    "obj-infinite": _raw(_NUMBERS, obj(_BOX.with_vertex(np.inf)), ".obj"),
    "obj-words": _raw(
        "unreadable OBJ file", obj(_BOX).replace(b"v 0", b"v wide", 1).replace(b"v -", b"v wide", 1), ".obj"
    ),
    "obj-flat-vertices": _raw(
        "OBJ has a vertex without three coordinates",
        b"v 0 0\nv 0.03 0\nv 0.03 0.03\nv 0 0.03\nf 1 2 3\nf 1 3 4\n",
        ".obj",
    ),
    "obj-cut": _raw(_HOLES.format(9), obj(_BOX)[:-9], ".obj"),
    # PLY
    "ply-no-end": _raw(_HEADER, ply(_BOX).replace(b"end_header\n", b""), ".ply"),
    "ply-no-faces": _raw(_EMPTY, ply(_BOX, faces=0), ".ply"),
    "ply-more-vertices": _raw(_SHORT.format(20, 812), ply(_BOX, vertices=800), ".ply"),
    "ply-more-faces": _raw(_SHORT.format(20, 808), ply(_BOX, faces=800), ".ply"),
    "ply-trillion": _raw(
        "unreadable PLY file.*unexpected length",
        ply(_BOX, vertices=10**12, form="binary_little_endian 1.0"),
        ".ply",
    ),
    "ply-negative": _raw(_EMPTY, ply(_BOX, vertices=-8), ".ply"),
    "ply-form": _raw("unreadable PLY file", ply(_BOX, form="braille 1.0"), ".ply"),
    "ply-beyond": _raw(_ABSENT, ply(_BOX._replace(faces=_BOX.faces + 90)), ".ply"),
    "ply-before": _raw(_ABSENT, ply(_BOX._replace(faces=_BOX.faces - 90)), ".ply"),
    "ply-from-minus-one": _raw(_ABSENT, ply(_BOX._replace(faces=_BOX.faces - 1)), ".ply"),
    "ply-nan": _raw(_NUMBERS, ply(_BOX.with_vertex(np.nan)), ".ply"),
    "ply-words": _raw(
        "unreadable PLY file", ply_header(_BOX, None, None, "ascii 1.0") + b"wide\n" * 20, ".ply"
    ),
    "ply-cut": _raw("unreadable PLY file.*unexpected length", _CUT_PLY[:-20], ".ply"),
    "ply-header-alone": _raw(_SHORT.format(0, 20), ply_header(_BOX, None, None, "ascii 1.0"), ".ply"),
    "ply-body-alone": _raw(_HEADER, ply_body(_BOX, "ascii 1.0"), ".ply"),
    "ply-types": _raw("unreadable PLY file.*decimal", ply(_BOX).replace(b"double", b"decimal"), ".ply"),
    # sizes
    "millimetres": _stl("is the file in millimetres", _BOX.scaled(1000)),
    "metres": _stl(_LARGE.format(1.5), _BOX.scaled(50)),
    "a-little-too-large": _stl(_LARGE.format(0.315), _BOX.scaled(10.5)),
    "astronomical": _stl(_LARGE.format("(2.9+.*|3.*)e.28"), _BOX.scaled(1e30)),
    "a-little-too-small": _stl(_SMALL.format(0.009), _BOX.scaled(0.3)),
    "kilometres": _stl(_SMALL.format("3e-05"), _BOX.scaled(1e-3)),
    "atomic": _stl(_SMALL.format("3e-11"), _BOX.scaled(1e-9)),
    "point": _stl(_SMALL.format("0.0"), _BOX.scaled(0)),
    "foil": _stl(r"is too small \[m\]; got 1e-05", box(0.05, 0.05, 1e-5)),
    "hair": _stl("unusable mass of object bad", box(0.1, 5e-5, 5e-5)),
    "far-away": _stl(_FLAT, _BOX.moved(1e9)),
    # surfaces that enclose nothing, or not enough
    "open-box": _stl(_HOLES.format(20), _BOX.without(10, 11)),
    "half-a-lid": _stl(_HOLES.format(9), _BOX.without(11)),
    "half-ball": _stl(_HOLES.format(64), ball(0.03).without(*range(230, 528))),
    "triangle": _stl(_EMPTY, Surface(_BOX.vertices, _BOX.faces[:1])),
    "square": _stl(_OPEN, _QUAD),
    "two-sided-square": _stl(_FLAT, together(_QUAD, _QUAD.turned_out())),
    "line": _stl(_EMPTY, Surface(_BOX.vertices * [1, 0, 0], _BOX.faces)),
    "plane": _stl(_FLAT, Surface(_BOX.vertices * [1, 1, 0], _BOX.faces)),
    "tape": _stl(_HOLES.format(167), strip(0)),
    "moebius": _stl(_OPEN, strip(1)),
    "crossed-sheets": _stl(_OPEN, together(_QUAD, Surface(_QUAD.vertices[:, [0, 2, 1]], _QUAD.faces))),
    "fin": _stl(_OPEN, together(_BOX, Surface(_BOX.vertices[[0, 7, 1]] * [1, 1, 2], np.array([(0, 1, 2)])))),
    # bodies that are several
    "apart": _stl(_APART.format(2, "10.0"), together(_BOX, _BOX.moved(0.04))),
    "three-apart": _stl(_APART.format(2, "29.5"), together(_BOX, _BOX.moved(0.0305), _BOX.moved(0.09))),
    "a-crumb-apart": _stl(_APART.format(2, "34.0"), together(_BOX, box(0.002, 0.002, 0.002).moved(0.05))),
    "many-solids": _stl(_MANY.format(40), together(*_ROW)),
    "dust": _stl(_MANY.format(400), together(*_DUST)),
    # bodies that are no use to the hand
    "large-cube": _stl(_HAND, box(0.2, 0.2, 0.2), dropped=True),
    "large-ball": _stl(_HAND, ball(0.12), dropped=True),
}
"""The files by name."""
