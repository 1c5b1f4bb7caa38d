"""The catalogue of evaluation objects, and objects made from a mesh file.

`assets/objects/generate.py` writes the catalogue: `objects.toml` and the meshes beside it. A mesh file
holds one convex piece per `o` group; simple pieces are primitives in the declaration itself.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.object_model import MAX_SIZE, OBJECT_GROUP, ObjectModel, Part, add_object
from mpgrasp.paths import OBJECT_ASSETS

__all__ = [
    "MAX_SIZE",
    "OBJECT_GROUP",
    "OBJECT_SETS",
    "ObjectModel",
    "Part",
    "add_object",
    "load_object",
    "object_from_mesh",
    "read_pieces",
]

OBJECT_SETS: dict[str, tuple[str, ...]] = {
    "thin": ("usb_stick", "key", "ruler", "pen", "card_stack", "washer", "plate_brick"),
    "toys": ("toy_car", "toy_dinosaur", "toy_rocket", "toy_boat"),
    "household": (
        "mug",
        "bottle",
        "can",
        "soap",
        "banana",
        "screwdriver",
        "tape_roll",
        "carton",
        "brush",
        "bowl",
    ),
}
"""Names of the catalogue's objects by set."""

CONVEX_ENOUGH = 0.97
"""A piece that fills this share of its convex hull is taken to be its hull."""


@cache
def load_object(name: str) -> ObjectModel:
    """The catalogue's object of that name.

    Raises:
        ConfigError: no such object.
        AssetError: its declaration or mesh cannot be used.
    """
    declaration = _declarations().get(name)
    if declaration is None:
        raise ConfigError("unknown object", got=name, allowed=(n for s in OBJECT_SETS.values() for n in s))
    try:
        parts = [_part(part) for part in declaration.get("parts", [])]
        if "mesh" in declaration:
            pieces = read_pieces(OBJECT_ASSETS / declaration["mesh"])
            parts += [Part(shape="mesh", vertices=piece) for piece in pieces]
        return ObjectModel(
            name=name,
            parts=tuple(parts),
            mass=float(declaration["mass"]),
            friction=float(declaration["friction"]),
            rgba=tuple(declaration["rgba"]),
            rolls=bool(declaration.get("rolls", False)),
            provenance=declaration["provenance"],
        )
    except KeyError as error:
        raise AssetError(f"declaration of object {name} lacks a field", got=error.args[0]) from None
    except (TypeError, ValueError) as error:  # text where a number belongs, and the like
        raise AssetError(f"unusable declaration of object {name}", got=str(error)) from None


def object_from_mesh(
    path: str | Path,
    *,
    name: str | None = None,
    density: float = 500.0,
    mass: float | None = None,
    friction: float = 0.6,
) -> ObjectModel:
    """An object from a mesh file in metres (OBJ, STL, PLY ...), its frame at the bounding box's centre.

    Each connected piece that is nearly convex becomes its hull; the others are cut up by CoACD, which
    can take seconds, so keep the object for as long as it is needed.

    Args:
        path: the file; its z axis is up.
        name: name of the object; the file's stem if not given.
        density: [kg/m^3], used where no mass is given.
        mass: [kg]
        friction: sliding friction coefficient.

    Raises:
        AssetError: unreadable, empty or metre-large mesh, or a mass that is not positive.
    """
    path = Path(path)
    pieces = [hull for mesh in _load_mesh(path) for hull in convex_pieces(mesh)]
    points = np.vstack(pieces)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    parts = tuple(Part(shape="mesh", vertices=piece - centre) for piece in pieces)
    if mass is None:
        mass = density * sum(part.volume for part in parts)
    return ObjectModel(
        name=name or path.stem,
        parts=parts,
        mass=mass,
        friction=friction,
        rgba=(0.75, 0.75, 0.75, 1.0),
        provenance=f"mesh file {path.name}",
    )


def convex_pieces(mesh: Any, threshold: float = 0.08) -> list[FloatArray]:
    """Vertices (n, 3) [m] of the convex pieces of a connected `trimesh.Trimesh`, by CoACD where needed.

    `threshold` is CoACD's concavity. A surface with holes counts as its hull: it has no inside to cut.
    """
    hull = mesh.convex_hull
    if not mesh.is_volume or mesh.volume >= CONVEX_ENOUGH * hull.volume:
        return [np.asarray(hull.vertices)]
    try:
        import coacd
    except ImportError:
        raise AssetError(
            "mesh is not convex",
            got=f"{mesh.volume / hull.volume:.0%} of its hull",
            allowed="pip install mpgrasp[assets]",
        ) from None
    coacd.set_log_level("error")
    cut = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=threshold,
        max_convex_hull=16,
        resolution=1000,
        seed=0,
    )
    return [np.asarray(vertices) for vertices, _ in cut]


def read_pieces(path: Path) -> list[FloatArray]:
    """Vertices (n, 3) [m] of each `o` group of an OBJ file, in the file's order.

    Raises:
        AssetError: unreadable or empty file, or a vertex that is not three numbers.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise AssetError("unreadable mesh file", got=str(path), allowed=str(error)) from None
    pieces: list[list[list[float]]] = []
    for line in lines:
        words = line.split()
        if words[:1] == ["o"] or (words[:1] == ["v"] and not pieces):
            pieces.append([])
        if words[:1] == ["v"]:
            try:
                x, y, z = map(float, words[1:4])
            except ValueError:
                raise AssetError(
                    f"mesh file {path} has a broken vertex", got=line[:60], allowed="v x y z"
                ) from None
            pieces[-1].append([x, y, z])
    arrays = [np.array(piece) for piece in pieces if piece]
    if not arrays:
        raise AssetError("mesh is empty", got=str(path), allowed="an OBJ file with vertices")
    return arrays


def _load_mesh(path: Path) -> list[Any]:
    """Connected pieces of a mesh file as `trimesh.Trimesh`, checked for emptiness and size."""
    try:
        import trimesh
    except ImportError:
        raise AssetError(
            "cannot read mesh files", got=str(path), allowed="pip install mpgrasp[assets]"
        ) from None
    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # each file type fails in its own way
        raise AssetError("unreadable mesh file", got=str(path), allowed=f"a mesh ({error})") from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0 or len(mesh.vertices) < 4:
        raise AssetError("mesh is empty", got=str(path), allowed="at least 4 vertices and their faces")
    if not np.isfinite(mesh.vertices).all():
        raise AssetError("mesh has vertices that are not numbers", got=str(path))
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    if extent > MAX_SIZE:
        raise AssetError(
            f"mesh {path.name} is too large [m]",
            got=round(extent, 4),
            allowed=f"edges up to {MAX_SIZE} m; is it saved in millimetres?",
        )
    pieces = mesh.split(only_watertight=False)
    return list(pieces) if len(pieces) else [mesh]


@cache
def _declarations() -> dict[str, dict[str, Any]]:
    path = OBJECT_ASSETS / "objects.toml"
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise AssetError("unreadable object catalogue", got=str(path), allowed=str(error)) from None


def _part(declaration: dict[str, Any]) -> Part:
    return Part(
        shape=declaration["shape"],
        size=tuple(declaration["size"]),
        position=tuple(declaration.get("position", (0.0, 0.0, 0.0))),
        quaternion=tuple(declaration.get("quaternion", (1.0, 0.0, 0.0, 0.0))),
    )
