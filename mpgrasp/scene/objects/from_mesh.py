"""Objects from anybody's mesh files: checked, closed where little is missing, cut up and weighed.

A mesh is simplified and cut into convex pieces by CoACD (Wei et al., "Approximate convex decomposition for
3D meshes with collision-aware concavity and tree search", ACM Transactions on Graphics 41(4), 2022), on one
thread and with a fixed seed. What came of a mesh is cached under the hash of its content and of all that
decides the outcome, a refusal as well.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from mpgrasp.exceptions import AssetError
from mpgrasp.extras import check_installed
from mpgrasp.files.cache import load_result, store_result
from mpgrasp.files.regular import read_regular
from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import product
from mpgrasp.scene.objects.model import MAX_SIZE, ObjectModel, Part, check_density
from mpgrasp.scene.objects.solids import require_together, share_of_union
from mpgrasp.scene.objects.surface import (
    MAX_PATCH,
    MIN_SIZE,
    NEGLIGIBLE,
    closed_shells,
    load_surface,
    simplified,
)

DENSITY = 500.0
"""Density of an object of which nothing else is known [kg/m^3]: light wood, or a half-full package."""
FRICTION = 0.6
"""Sliding friction coefficient of such an object."""
TOLERANCE = 0.004
"""Distance by which the convex pieces may depart from the mesh [m]."""
MAX_PIECES = 16
MAX_SOLIDS = 32
"""Most closed surfaces in one mesh: each is a body of its own, with contacts of its own."""
MAX_FACES = 2500
"""A mesh with more is simplified before it is cut: CoACD's time grows with them."""
MAX_VERTICES = 200
"""A convex piece with more keeps those that are extreme in as many directions."""
CONVEX_ENOUGH = 0.97
"""A piece that fills this share of its convex hull is taken to be its hull."""

MAX_FILE = 200.0
"""Largest file of a mesh [MB]: four million faces."""

_COACD = {"max_convex_hull": MAX_PIECES, "resolution": 1000, "mcts_nodes": 12, "mcts_iterations": 40,
          "mcts_max_depth": 2, "preprocess_mode": "off", "seed": 0}  # fmt: skip
_PACKAGES = ("coacd", "fast-simplification", "trimesh")
_REVISION = 2  # raised whenever this module makes something else of the same mesh


class CachedBody(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Content of a cache file: what came of a mesh."""

    pieces: list[Annotated[list[tuple[float, float, float]], msgspec.Meta(min_length=4)]] = []
    volume: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    refused: str | None = None
    """Reason why the mesh cannot be used; None if it can."""

    def __post_init__(self) -> None:
        if self.refused is None and not (self.pieces and self.volume > 0):
            raise ValueError("neither a body nor a reason why there is none")


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshBody:
    """A mesh as convex pieces, its frame at the centre of its bounding box, z as in the file."""

    pieces: tuple[FloatArray, ...]
    """Vertices (n, 3) [m] of each."""
    volume: float
    """Volume of the mesh itself [m^3]: the pieces overlap a little and fill hollows up to the tolerance."""
    key: str
    """Hash of the file's content and of all that decides what is made of it."""

    def __post_init__(self) -> None:
        for piece in self.pieces:
            piece.setflags(write=False)

    @cached_property
    def size(self) -> tuple[float, float, float]:
        """Edges of the bounding box [m]."""
        x, y, z = np.ptp(np.vstack(self.pieces), axis=0)
        return float(x), float(y), float(z)

    def as_object(
        self,
        name: str,
        *,
        density: float = DENSITY,
        mass: float | None = None,
        friction: float | None = None,
        provenance: str = "",
    ) -> ObjectModel:
        """The object of a mass [kg], or of a density [kg/m^3]; all its parts have friction against rolling.

        Raises:
            AssetError: a name that no object can have.
            ConfigError: a density that nothing has.
        """
        check_density(density)
        return ObjectModel(
            name=name,
            parts=tuple(Part(shape="mesh", vertices=piece) for piece in self.pieces),
            mass=density * self.volume if mass is None else mass,
            friction=FRICTION if friction is None else friction,
            rolls=True,  # a scanned can or ball says of itself only that it is a mesh
            provenance=provenance,
        )


def require_packages() -> None:
    """Raise ConfigError unless all that reads and cuts meshes is installed."""
    for name in _PACKAGES:
        check_installed(name.replace("-", "_"), "a mesh file")


def mesh_key(path: Path, scale: float = 1.0) -> str:
    """Hash of a mesh file's content, of its unit [m], of how it is treated, and of the packages that do it.

    Raises:
        AssetError: unreadable file.
    """
    treatment = {
        "revision": _REVISION,
        "type": path.suffix.lower(),
        "coacd": _COACD,
        "tolerances": [MIN_SIZE, MAX_SIZE, MAX_PATCH, NEGLIGIBLE, TOLERANCE, MAX_FACES, MAX_VERTICES],
        "packages": {name: metadata.version(name) for name in _PACKAGES},
        **({} if scale == 1 else {"scale": scale}),
    }
    digest = hashlib.sha256(json.dumps(treatment, sort_keys=True).encode())
    digest.update(_content(path))
    return digest.hexdigest()


def read_body(path: Path, scale: float = 1.0) -> MeshBody:
    """The convex pieces of a mesh file (GLB, OBJ, PLY or STL); takes seconds unless it is cached.

    Args:
        path: of the file.
        scale: unit of its numbers [m]: 0.001 for millimetres.

    Raises:
        AssetError: a mesh that is unreadable, empty, of an implausible size, or not closed and not to be
            closed. The message does not name the file.
    """
    require_packages()
    key = mesh_key(path, scale)
    result = load_result("meshes", key, CachedBody)
    if result is None:
        try:
            with np.errstate(divide="ignore", invalid="ignore"):  # flat surfaces have no centre of mass
                pieces, volume = _make_body(load_surface(_content(path), path.suffix.lower(), scale))
            result = CachedBody(pieces=[piece.tolist() for piece in pieces], volume=volume)
        except AssetError as error:
            result = CachedBody(refused=str(error))
        store_result("meshes", key, result)
    if result.refused is not None:
        raise AssetError(result.refused)
    return MeshBody(pieces=tuple(np.array(piece) for piece in result.pieces), volume=result.volume, key=key)


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, MAX_FILE)
    except OSError as error:
        raise AssetError("unreadable file", allowed=f"a readable one ({error.strerror})") from None


def _make_body(mesh: Any) -> tuple[list[FloatArray], float]:
    """Convex pieces, centred, and volume [m^3] of the whole."""
    shells = closed_shells(mesh)
    if all(shell.volume < 0 for shell in shells):  # inside out as a whole
        for shell in shells:
            shell.invert()
    solids = [shell for shell in shells if shell.volume > 0]  # the others bound hollows nobody gets to
    if len(solids) > MAX_SOLIDS:
        raise AssetError("mesh is of many bodies", got=len(solids), allowed=f"up to {MAX_SOLIDS}")
    cut = [[_thinned(piece) for piece in _cut(solid)] for solid in solids]
    require_together(cut)
    # solids that lie in one another take up their common space once
    volume = float(sum(solid.volume for solid in solids)) * share_of_union(cut)
    pieces = [piece for of_solid in cut for piece in of_solid]
    points = np.vstack(pieces)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return [piece - centre for piece in pieces], volume


def _cut(solid: Any) -> list[FloatArray]:
    """Vertices (n, 3) [m] of the convex pieces of one closed surface."""
    hull = solid.convex_hull
    if solid.volume >= CONVEX_ENOUGH * hull.volume:
        return [np.asarray(hull.vertices)]
    os.environ["OMP_NUM_THREADS"] = "1"  # read when the library is loaded; results may depend on it
    import coacd

    if len(solid.faces) > MAX_FACES:
        solid = simplified(solid, MAX_FACES)
    coacd.set_log_level("error")
    threshold = float(np.clip(2 * TOLERANCE / solid.extents.max(), 0.01, 1))  # CoACD counts in half extents
    cut = coacd.run_coacd(coacd.Mesh(solid.vertices, solid.faces), threshold=threshold, **_COACD)
    if not cut:
        raise AssetError("mesh cannot be cut into convex pieces")
    return [np.asarray(vertices) for vertices, _ in cut]


def _thinned(vertices: FloatArray) -> FloatArray:
    """Vertices of the hull; of many, those that are extreme in some direction: 0.2 mm less on an apple."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners = np.asarray(vertices[np.sort(ConvexHull(vertices).vertices)])
    except QhullError:
        raise AssetError("mesh has a flat piece", got=f"{len(vertices)} vertices in one plane") from None
    if len(corners) <= MAX_VERTICES:
        return corners
    k = np.arange(MAX_VERTICES)
    z, turn = 1 - (2 * k + 1) / MAX_VERTICES, k * np.pi * (3 - np.sqrt(5))  # a Fibonacci spiral
    around = np.sqrt(1 - z**2)[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    directions = np.vstack([np.eye(3), -np.eye(3), np.column_stack([around, z])])
    return np.asarray(corners[np.unique(np.argmax(product(corners, directions.T), axis=0))])
