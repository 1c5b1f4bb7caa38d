"""The catalogue of evaluation objects, read from its declarations and meshes.

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
from mpgrasp.paths import OBJECT_ASSETS
from mpgrasp.scene.objects.model import ObjectModel, Part

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
