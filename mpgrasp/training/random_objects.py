"""Random parametric objects and scenes to train on.

They are drawn from continuous families of primitives and hulls, never from the catalogue, and anything
that comes close to the size of an evaluation object is drawn again: training and evaluation stay apart.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.geometry import FloatArray
from mpgrasp.object_model import ObjectModel, Part
from mpgrasp.objects import OBJECT_SETS, load_object
from mpgrasp.scene import WORKSPACE_CENTRE, SceneConfig

GRASPABLE = 0.072
"""Widest thing that the gripper closes on with a little room [m]."""
LONGEST = 0.2
"""Longest edge of a bounding box [m]."""
DENSITY = (200.0, 1500.0)
"""[kg/m^3]"""
LIGHTEST = 0.001
"""[kg]"""
LIKENESS = 0.15
"""A box whose three edges all lie within this share of an evaluation object's is drawn again."""
THIN_HEIGHT = (0.002, 0.012)
"""Heights of thin objects [m]."""
THIN_SCENES = 0.5
"""Share of the scenes that hold thin objects alone."""

Family = Callable[[np.random.Generator], list[Part]]
"""Draws the parts of one object."""


def random_object(rng: np.random.Generator, name: str, thin: bool) -> ObjectModel:
    """A random object: a box, stick, plate, disc, ring, letter, stack, hull ...

    Args:
        rng: source of all that is random.
        name: name of the object.
        thin: lie 2 to 12 mm high.
    """
    while True:
        parts = _pick(rng, _THIN_FAMILIES if thin else _FAMILIES)(rng)
        density, friction, (r, g, b) = rng.uniform(*DENSITY), rng.uniform(0.4, 0.9), rng.uniform(0.15, 0.9, 3)
        size = np.ptp(np.vstack([part.points for part in parts]), axis=0)
        mass = density * sum(part.volume for part in parts)
        if size.max() > LONGEST or mass < LIGHTEST or resembles_evaluation_object(size):
            continue
        return ObjectModel(
            name=name,
            parts=tuple(parts),
            mass=mass,
            friction=friction,
            rgba=(float(r), float(g), float(b), 1.0),
            provenance="random",
        )


def training_scene_config(rng: np.random.Generator) -> SceneConfig:
    """A random training scene: 1 to 10 objects, half of the scenes with thin objects alone."""
    thin_alone = rng.random() < THIN_SCENES
    thin_share = 1.0 if thin_alone else 0.15
    n = 1 + min(rng.geometric(0.3) - 1, 9)
    objects = tuple(random_object(rng, f"train_{k}", bool(rng.random() < thin_share)) for k in range(n))
    pile = n > 1 and rng.random() < 0.4
    offset = rng.uniform(-0.2, 0.2, 2)
    # many objects need room; a pile makes its own
    half_extent = (
        rng.uniform(0.06, 0.09) + 0.02 * np.sqrt(n) if pile else rng.uniform(0.02, 0.05) + 0.045 * np.sqrt(n)
    )
    return SceneConfig(
        objects=objects,
        placing="pile" if pile else "scatter",
        pose="upright" if thin_alone and not pile else str(rng.choice(["upright", "random"])),  # type: ignore[arg-type]
        centre=(WORKSPACE_CENTRE[0] + offset[0] * 0.8, WORKSPACE_CENTRE[1] + offset[1]),
        half_extent=half_extent,
        cloth_unevenness=0.0 if rng.random() < 0.1 else rng.uniform(0.0, 0.0015),
        cloth_wavelength=rng.uniform(0.04, 0.15),
    )


def resembles_evaluation_object(size: ArrayLike) -> bool:
    """Whether all three edges `size` [m], however turned, lie within `LIKENESS` of an evaluation object's."""
    ratio = np.sort(np.asarray(size, float)) / _evaluation_sizes()
    return bool((np.abs(ratio - 1) < LIKENESS).all(axis=1).any())


@cache
def _evaluation_sizes() -> FloatArray:
    """(n, 3) sorted edges of the catalogue's bounding boxes [m]."""
    return np.array([np.sort(load_object(name).size) for names in OBJECT_SETS.values() for name in names])


def _pick(rng: np.random.Generator, families: dict[Family, float]) -> Family:
    weights = np.array(list(families.values()))
    return list(families)[rng.choice(len(families), p=weights / weights.sum())]


def _box(size: ArrayLike, position: tuple[float, float, float] = (0.0, 0.0, 0.0), yaw: float = 0.0) -> Part:
    """Box of full edges `size` [m]."""
    return Part(
        shape="box",
        size=tuple(np.asarray(size, float) / 2),
        position=position,
        quaternion=(np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)),
    )


_STANDING = (1.0, 0.0, 0.0, 0.0)
_LYING = (float(np.sqrt(0.5)), 0.0, float(np.sqrt(0.5)), 0.0)  # turns a part's z axis into x


def _thickness(rng: np.random.Generator) -> float:
    """Half of them within the lower 3 mm to 7 mm, where the trouble is."""
    low, high = THIN_HEIGHT
    return float(low + (high - low) * rng.beta(1.3, 1.9))


def _thin_plate(rng: np.random.Generator) -> list[Part]:
    return [_box((rng.uniform(0.025, 0.11), rng.uniform(0.012, 0.07), _thickness(rng)))]


def _thin_stick(rng: np.random.Generator) -> list[Part]:
    width = rng.uniform(0.006, 0.025)
    return [_box((rng.uniform(0.04, 0.18), width, min(_thickness(rng), 1.2 * width)))]


def _thin_stepped(rng: np.random.Generator) -> list[Part]:
    """A body with a narrower, lower tongue in front: plugs, keys, blades."""
    h, length, width = _thickness(rng), rng.uniform(0.02, 0.07), rng.uniform(0.012, 0.035)
    tongue = np.array([rng.uniform(0.008, 0.06), width * rng.uniform(0.3, 0.9), h * rng.uniform(0.4, 1.0)])
    lift = 0.0 if rng.random() < 0.5 else -(h - tongue[2]) / 2
    return [
        _box((length, width, h)),
        _box(tongue, ((length + tongue[0]) / 2, rng.uniform(-0.5, 0.5) * (width - tongue[1]), lift)),
    ]


def _thin_disc(rng: np.random.Generator) -> list[Part]:
    return [Part(shape="cylinder", size=(rng.uniform(0.01, 0.034), _thickness(rng) / 2))]


def _thin_ring(rng: np.random.Generator) -> list[Part]:
    return _ring(rng.uniform(0.012, 0.04), rng.uniform(0.005, 0.014), _thickness(rng))


def _thin_letter(rng: np.random.Generator) -> list[Part]:
    return _letter(rng, _thickness(rng), rng.uniform(0.006, 0.022), rng.uniform(0.03, 0.09))


def _thin_rod(rng: np.random.Generator) -> list[Part]:
    radius = _thickness(rng) / 2
    shape = "capsule" if rng.random() < 0.5 else "cylinder"
    return [Part(shape=shape, size=(radius, rng.uniform(0.02, 0.08)), quaternion=_LYING)]


def _thin_hull(rng: np.random.Generator) -> list[Part]:
    """A pebble-like or polygonal slab."""
    outline = rng.uniform(0.012, 0.04) * _polygon(rng) * (1.0, rng.uniform(0.4, 1.0))
    h, taper = _thickness(rng), rng.uniform(0.7, 1.0)
    bottom = np.column_stack([outline, np.full(len(outline), -h / 2)])
    top = np.column_stack([outline * taper, np.full(len(outline), h / 2)])
    return [Part(shape="mesh", vertices=np.vstack([bottom, top]))]


def _block(rng: np.random.Generator) -> list[Part]:
    return [_box((rng.uniform(0.02, 0.12), rng.uniform(0.012, GRASPABLE), rng.uniform(0.01, 0.09)))]


def _stick(rng: np.random.Generator) -> list[Part]:
    return [_box((rng.uniform(0.05, 0.18), rng.uniform(0.01, 0.035), rng.uniform(0.01, 0.035)))]


def _cylinder(rng: np.random.Generator) -> list[Part]:
    size = (rng.uniform(0.008, 0.035), rng.uniform(0.01, 0.06))
    return [Part(shape="cylinder", size=size, quaternion=_LYING if rng.random() < 0.6 else _STANDING)]


def _capsule(rng: np.random.Generator) -> list[Part]:
    size = (rng.uniform(0.008, 0.03), rng.uniform(0.008, 0.06))
    return [Part(shape="capsule", size=size, quaternion=_LYING)]


def _ellipsoid(rng: np.random.Generator) -> list[Part]:
    return [Part(shape="ellipsoid", size=(rng.uniform(0.015, 0.06), *rng.uniform(0.01, 0.034, 2)))]


def _thick_ring(rng: np.random.Generator) -> list[Part]:
    return _ring(rng.uniform(0.018, 0.045), rng.uniform(0.006, 0.02), rng.uniform(0.01, 0.04))


def _thick_letter(rng: np.random.Generator) -> list[Part]:
    return _letter(rng, rng.uniform(0.012, 0.05), rng.uniform(0.01, 0.035), rng.uniform(0.04, 0.12))


def _hull(rng: np.random.Generator) -> list[Part]:
    points = rng.standard_normal((rng.integers(8, 20), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    half = (rng.uniform(0.015, 0.05), rng.uniform(0.012, 0.034), rng.uniform(0.01, 0.034))
    return [Part(shape="mesh", vertices=points * half)]


def _stacked(rng: np.random.Generator) -> list[Part]:
    """Two or three primitives on top of or beside each other, fused."""
    parts, x, top = [], 0.0, 0.0
    for _ in range(rng.integers(2, 4)):
        half = np.array([rng.uniform(0.01, 0.04), rng.uniform(0.008, 0.034), rng.uniform(0.006, 0.022)])
        position = (x + rng.uniform(-0.3, 0.3) * half[0], rng.uniform(-0.008, 0.008), top + 0.9 * half[2])
        if rng.random() < 0.6:
            parts.append(Part(shape="box", size=tuple(half), position=position))
        else:
            parts.append(Part(shape="cylinder", size=(half[1], half[2]), position=position))
        if rng.random() < 0.6:
            top += 1.8 * half[2]
        else:
            x += half[0] + 0.008
    return parts


def _handled(rng: np.random.Generator) -> list[Part]:
    """A head with a handle: hammers, brushes, screwdrivers, pans."""
    radius, length = rng.uniform(0.006, 0.016), rng.uniform(0.03, 0.06)
    kind = "capsule" if rng.random() < 0.5 else "cylinder"
    handle = Part(shape=kind, size=(radius, length), quaternion=_LYING)
    half = (rng.uniform(0.008, 0.03), rng.uniform(0.01, 0.034), rng.uniform(0.006, 0.025))
    shape = "box" if rng.random() < 0.6 else "ellipsoid"
    return [handle, Part(shape=shape, size=half, position=(length + 0.8 * half[0], 0.0, 0.0))]


def _ring(radius: float, width: float, height: float, n: int = 12) -> list[Part]:
    """Boxes around a circle: outer radius, radial width and height [m]."""
    width = min(width, 0.75 * radius)
    middle = radius - width / 2
    tangent = 2 * radius * np.tan(np.pi / n)
    angles = 2 * np.pi * np.arange(n) / n
    size = (width, tangent, height)
    return [_box(size, (middle * np.cos(a), middle * np.sin(a), 0.0), yaw=float(a)) for a in angles]


def _letter(rng: np.random.Generator, height: float, width: float, length: float) -> list[Part]:
    """An L, T, U or cross of bars `width` wide and up to `length` long [m]."""
    arm = length * rng.uniform(0.4, 1.0)
    bar = _box((length, width, height))
    side = (arm + width) / 2
    end = (length - width) / 2
    kind = rng.choice(["L", "T", "U", "X"])
    if kind == "X":
        return [bar, _box((width, arm, height), (rng.uniform(-0.3, 0.3) * length, 0.0, 0.0))]
    places = {"L": [end], "T": [0.0], "U": [-end, end]}[str(kind)]
    return [bar, *(_box((width, arm, height), (x, side - width / 2, 0.0)) for x in places)]


def _polygon(rng: np.random.Generator) -> FloatArray:
    """(n, 2) corners in the unit circle, 3 to 8 of them, spread around the centre."""
    n = int(rng.integers(3, 9))
    angles = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    return rng.uniform(0.75, 1.0, n)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


_THIN_FAMILIES: dict[Family, float] = {
    _thin_plate: 3,
    _thin_stick: 4,
    _thin_stepped: 3,
    _thin_disc: 1.5,
    _thin_ring: 1,
    _thin_letter: 1.5,
    _thin_rod: 1.5,
    _thin_hull: 1.5,
}
_FAMILIES: dict[Family, float] = {
    _block: 3,
    _stick: 2,
    _cylinder: 2,
    _capsule: 1,
    _ellipsoid: 1.5,
    _thick_ring: 1,
    _thick_letter: 2,
    _hull: 2,
    _stacked: 3,
    _handled: 2,
}
