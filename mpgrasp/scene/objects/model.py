"""A rigid object as a union of convex parts: shape, mass, friction and colour.

A camera sees the same parts that a finger touches, so that the true shape, the depth image and the
contacts can never disagree. `free_body` puts an object into a MuJoCo model.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.geometry import FloatArray, rotation_from_quaternion, transform, transform_points
from mpgrasp.names import check_name

OBJECT_GROUP = 1
"""Geom group of all objects: height maps cast their rays at this group alone."""
MAX_SIZE = 0.3
"""Largest edge of an object's bounding box [m]; anything above was most likely saved in millimetres."""
MIN_EDGE = 2e-4
"""Smallest edge of an object's bounding box [m]; contacts give way by as much."""
MASSES = (1e-5, 100.0)
"""Least and greatest mass of an object [kg]: a crumb of foam, and thirty times what the arm carries."""

DENSITIES = (1.0, 25000.0)
"""Least and greatest density of an object [kg/m^3], foam to heavy metal."""

_SIZES = {"box": 3, "cylinder": 2, "capsule": 2, "ellipsoid": 3, "mesh": 0}
"""Number of half sizes of each shape."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """One convex piece: a primitive with its pose in the object's frame, or the hull of vertices."""

    shape: str
    """box, cylinder, capsule, ellipsoid or mesh."""
    size: tuple[float, ...] = ()
    """Half sizes [m] as in MuJoCo: box, ellipsoid (x, y, z); cylinder, capsule (radius, half length)."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """[m]"""
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """wxyz, unit length."""
    vertices: FloatArray | None = None
    """(n, 3) [m], of a mesh: the part is their convex hull."""

    def __post_init__(self) -> None:
        if self.shape not in _SIZES:
            raise AssetError("unknown shape of a part", got=self.shape, allowed=_SIZES)
        for what, numbers, n in (("position", self.position, 3), ("quaternion", self.quaternion, 4)):
            if np.shape(numbers) != (n,) or not np.isfinite(numbers).all():
                raise AssetError(f"unusable {what} of a {self.shape}", got=numbers, allowed=f"{n} numbers")
        size = tuple(float(s) for s in self.size)
        if len(size) != _SIZES[self.shape] or not all(0 < s < np.inf for s in size):
            raise AssetError(
                f"unusable size of a {self.shape}",
                got=self.size,
                allowed=f"{_SIZES[self.shape]} positive lengths [m]",
            )
        if self.shape == "mesh":
            vertices = np.asarray([] if self.vertices is None else self.vertices, float).reshape(-1, 3)
            if len(vertices) < 4 or not np.isfinite(vertices).all():
                raise AssetError(
                    "mesh is empty", got=f"{len(vertices)} vertices", allowed="at least 4, all finite"
                )
            object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "size", size)

    @property
    def T_object_part(self) -> FloatArray:
        """Pose (4, 4) of the part in the object."""
        return transform(rotation_from_quaternion(self.quaternion), self.position)

    @cached_property
    def points(self) -> FloatArray:
        """(n, 3) [m] points of the part's surface in the object's frame; their hull fills it to about 2 %."""
        T = self.T_object_part
        return transform_points(T, self._local_points())

    @cached_property
    def volume(self) -> float:
        """Volume [m^3]."""
        s = self.size
        if self.shape == "box":
            return 8 * s[0] * s[1] * s[2]
        if self.shape == "cylinder":
            return 2 * np.pi * s[0] ** 2 * s[1]
        if self.shape == "capsule":
            return np.pi * s[0] ** 2 * (2 * s[1] + 4 / 3 * s[0])
        if self.shape == "ellipsoid":
            return 4 / 3 * np.pi * s[0] * s[1] * s[2]
        from scipy.spatial import ConvexHull, QhullError  # takes long to import, and few scenes need it

        try:
            return float(ConvexHull(self.points).volume)
        except QhullError:
            raise AssetError("mesh is flat", got=f"{len(self.points)} vertices in one plane") from None

    def _local_points(self) -> FloatArray:
        if self.shape == "mesh":
            assert self.vertices is not None
            return self.vertices
        s = self.size
        if self.shape == "box":
            return np.array(np.meshgrid(*[(-a, a) for a in s])).reshape(3, -1).T
        if self.shape == "cylinder":
            a = np.arange(24) * np.pi / 12
            ring = np.column_stack([np.cos(a), np.sin(a)]) * s[0]
            return np.vstack([np.column_stack([ring, np.full(24, z)]) for z in (-s[1], s[1])])
        if self.shape == "capsule":
            ball = _SPHERE * s[0]
            return np.vstack([ball + np.array([0, 0, z]) for z in (-s[1], s[1])])
        return _SPHERE * s


def _sphere_points(n: int = 162) -> FloatArray:
    """Points (n + 6, 3) on the unit sphere: a Fibonacci spiral and the six poles of the axes."""
    k = np.arange(n)
    z = 1 - (2 * k + 1) / n
    a = k * np.pi * (3 - np.sqrt(5))
    r = np.sqrt(1 - z**2)
    points = np.column_stack([r * np.cos(a), r * np.sin(a), z])
    return np.vstack([points, np.eye(3), -np.eye(3)])


_SPHERE = _sphere_points()


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectModel:
    """A rigid object. Its frame has z up in the pose in which the object is meant to stand or lie."""

    name: str
    parts: tuple[Part, ...]
    mass: float
    """[kg]"""
    friction: float = 0.6
    """Sliding friction coefficient against everything: cloth, pads (an object's contacts are its own)."""
    rgba: tuple[float, float, float, float] = (0.75, 0.75, 0.75, 1.0)
    rolls: bool = False
    """All parts have friction against rolling; cylinders, capsules and ellipsoids have it anyway."""
    provenance: str = ""
    """Source of shape and mass."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", tuple(self.parts))
        check_name(self.name)
        if not self.parts:
            raise AssetError(f"object {self.name} is empty", got="no parts", allowed="at least one part")
        if not MASSES[0] <= self.mass <= MASSES[1]:
            raise AssetError(
                f"unusable mass of object {self.name} [kg]",
                got=float(f"{self.mass:.3g}"),
                allowed=f"{MASSES[0]:g} to {MASSES[1]:g}",
            )
        if not 0 < self.friction < np.inf:
            raise AssetError(f"unusable friction of object {self.name}", got=self.friction, allowed="above 0")
        if np.shape(self.rgba) != (4,):
            raise AssetError(
                f"unusable rgba of object {self.name}", got=self.rgba, allowed="4 numbers, 0 to 1"
            )
        if max(self.size) > MAX_SIZE:
            raise AssetError(
                f"object {self.name} is too large [m]",
                got=round(float(max(self.size)), 4),
                allowed=f"edges up to {MAX_SIZE} m; is it saved in millimetres?",
            )
        if self.volume <= 0:
            raise AssetError(f"object {self.name} has no volume", got=self.volume)
        if min(self.size) < MIN_EDGE:
            raise AssetError(
                f"object {self.name} is too small [m]",
                got=float(f"{min(self.size):.3g}"),
                allowed=f"edges of {MIN_EDGE} m or more",
            )

    @cached_property
    def points(self) -> FloatArray:
        """(n, 3) [m] points of the parts' surfaces, in the object's frame."""
        return np.vstack([part.points for part in self.parts])

    @cached_property
    def size(self) -> tuple[float, float, float]:
        """Edges of the bounding box (x, y, z) [m]."""
        x, y, z = np.ptp(self.points, axis=0)
        return float(x), float(y), float(z)

    @cached_property
    def volume(self) -> float:
        """Sum over the parts [m^3]; overlaps count twice."""
        return sum(part.volume for part in self.parts)


def check_density(density: float) -> None:
    """Raise ConfigError unless something may have this density [kg/m^3]."""
    low, high = DENSITIES
    if not low <= density <= high:
        raise ConfigError("density out of range [kg/m^3]", got=density, allowed=f"{low:g} to {high:g}")
