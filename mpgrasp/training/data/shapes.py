"""Building blocks of random objects: bars, rings, letters, and shells of revolution in convex pieces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.geometry import FloatArray
from mpgrasp.scene.objects.model import Part

GRASPABLE = 0.072
"""Widest thing that the gripper closes on with a little room [m]."""
THIN_HEIGHT = (0.0008, 0.012)
"""Heights of thin objects [m]."""
STANDING = (1.0, 0.0, 0.0, 0.0)
"""Leaves a part's z axis upright."""
LYING = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)
"""Turns a part's z axis into x."""

Family = Callable[[np.random.Generator], list[Part]]
"""Draws the parts of one object."""


def box(size: ArrayLike, position: tuple[float, float, float] = (0.0, 0.0, 0.0), yaw: float = 0.0) -> Part:
    """Box of full edges `size` [m]."""
    return Part(
        shape="box",
        size=tuple(np.asarray(size, float) / 2),
        position=position,
        quaternion=(np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)),
    )


def thickness(rng: np.random.Generator) -> float:
    """Height of a thin object [m], half of them up to 4 mm, where the trouble is: even in its logarithm."""
    return float(np.exp(rng.uniform(*np.log(THIN_HEIGHT))))


def ring(radius: float, width: float, height: float, n: int = 12) -> list[Part]:
    """Boxes around a circle: outer radius, radial width and height [m]."""
    width = min(width, 0.75 * radius)
    middle = radius - width / 2
    tangent = 2 * radius * np.tan(np.pi / n)
    angles = 2 * np.pi * np.arange(n) / n
    size = (width, tangent, height)
    return [box(size, (middle * np.cos(a), middle * np.sin(a), 0.0), yaw=float(a)) for a in angles]


def letter(rng: np.random.Generator, height: float, width: float, length: float) -> list[Part]:
    """An L, T, U or cross of bars `width` wide and up to `length` long [m]."""
    arm = length * rng.uniform(0.4, 1.0)
    bar = box((length, width, height))
    side = (arm + width) / 2
    end = (length - width) / 2
    kind = rng.choice(["L", "T", "U", "X"])
    if kind == "X":
        return [bar, box((width, arm, height), (rng.uniform(-0.3, 0.3) * length, 0.0, 0.0))]
    places = {"L": [end], "T": [0.0], "U": [-end, end]}[str(kind)]
    return [bar, *(box((width, arm, height), (x, side - width / 2, 0.0)) for x in places)]


def polygon(rng: np.random.Generator) -> FloatArray:
    """Draw corners (n, 2) in the unit circle, 3 to 8 of them, spread around the centre."""
    n = int(rng.integers(3, 9))
    angles = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    radii = rng.uniform(0.75, 1.0, n)
    corners: FloatArray = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return corners


def shell(outer: ArrayLike, inner: ArrayLike, n: int, turn: float = 2 * np.pi) -> list[Part]:
    """The wall between two profiles turned about z, in `n` convex pieces.

    Args:
        outer: (k, 2) radius and height [m] along the outside.
        inner: (k, 2) the same along the inside.
        n: pieces around.
        turn: angle that the wall goes around [rad].
    """
    profile = np.vstack([outer, inner])
    angles = np.linspace(0, turn, n + 1)
    rings = [
        np.column_stack([profile[:, 0] * np.cos(a), profile[:, 0] * np.sin(a), profile[:, 1]]) for a in angles
    ]
    return [Part(shape="mesh", vertices=np.vstack([rings[k], rings[k + 1]])) for k in range(n)]


def bar(start: ArrayLike, end: ArrayLike, width: float, height: float) -> Part:
    """A box from one point of the xy plane to another, `width` broad and `height` high [m], z centred."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    x, y = (a + b) / 2
    yaw = float(np.arctan2(*(b - a)[::-1]))
    return box((float(np.hypot(*(b - a))), width, height), (float(x), float(y), 0.0), yaw=yaw)


def lay_down(parts: list[Part]) -> list[Part]:
    """Mesh parts with their z axis turned into x."""
    return [
        Part(shape="mesh", vertices=np.asarray(part.vertices)[:, [2, 1, 0]] * (1, 1, -1)) for part in parts
    ]


def open_box(size: ArrayLike, wall: float) -> list[Part]:
    """A floor and four walls, of outer edges `size` (3,) and thickness `wall` [m]."""
    x, y, z = np.asarray(size, float)
    floor = box((x, y, wall), (0.0, 0.0, (wall - z) / 2))
    long = [box((x, wall, z), (0.0, s * (y - wall) / 2, 0.0)) for s in (-1, 1)]
    short = [box((wall, y, z), (s * (x - wall) / 2, 0.0, 0.0)) for s in (-1, 1)]
    return [floor, *long, *short]
