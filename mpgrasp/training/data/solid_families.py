"""Families of thicker objects without hollows."""

from __future__ import annotations

import numpy as np

from mpgrasp.scene.objects.model import Part
from mpgrasp.training.data.shapes import GRASPABLE, LYING, STANDING, Family, box, letter, ring


def _block(rng: np.random.Generator) -> list[Part]:
    return [box((rng.uniform(0.02, 0.12), rng.uniform(0.012, GRASPABLE), rng.uniform(0.01, 0.09)))]


def _stick(rng: np.random.Generator) -> list[Part]:
    return [box((rng.uniform(0.05, 0.18), rng.uniform(0.01, 0.035), rng.uniform(0.01, 0.035)))]


def _cylinder(rng: np.random.Generator) -> list[Part]:
    size = (rng.uniform(0.008, 0.035), rng.uniform(0.01, 0.06))
    return [Part(shape="cylinder", size=size, quaternion=LYING if rng.random() < 0.6 else STANDING)]


def _capsule(rng: np.random.Generator) -> list[Part]:
    size = (rng.uniform(0.008, 0.03), rng.uniform(0.008, 0.06))
    return [Part(shape="capsule", size=size, quaternion=LYING)]


def _ellipsoid(rng: np.random.Generator) -> list[Part]:
    return [Part(shape="ellipsoid", size=(rng.uniform(0.015, 0.06), *rng.uniform(0.01, 0.034, 2)))]


def _thick_ring(rng: np.random.Generator) -> list[Part]:
    return ring(rng.uniform(0.018, 0.045), rng.uniform(0.006, 0.02), rng.uniform(0.01, 0.04))


def _thick_letter(rng: np.random.Generator) -> list[Part]:
    return letter(rng, rng.uniform(0.012, 0.05), rng.uniform(0.01, 0.035), rng.uniform(0.04, 0.12))


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
    handle = Part(shape=kind, size=(radius, length), quaternion=LYING)
    half = (rng.uniform(0.008, 0.03), rng.uniform(0.01, 0.034), rng.uniform(0.006, 0.025))
    shape = "box" if rng.random() < 0.6 else "ellipsoid"
    return [handle, Part(shape=shape, size=half, position=(length + 0.8 * half[0], 0.0, 0.0))]


SOLID_FAMILIES: dict[Family, float] = {
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
"""Families and how often each is drawn."""
