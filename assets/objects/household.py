"""The set of household objects; millimetres and grams."""

from __future__ import annotations

import numpy as np
from shapes import Declared, box, frustum, hull, ring, rod, tube


def mug() -> Declared:
    """Mug with a handle."""
    handle = [box(20, 9, 8, (38, 0, 52)), box(20, 9, 8, (38, 0, 20)), box(8, 9, 40, (46, 0, 36))]
    return Declared(
        [*ring((26, 28), (30, 32), 4, 70, 16), frustum(30, 30.2, 0, 5), *handle],
        190,
        0.5,
        (0.86, 0.84, 0.78),
        "small stoneware mug, 64 mm across, 70 mm high; 190 g",
    )


def bottle() -> Declared:
    """Drink bottle, standing."""
    parts = [
        rod("cylinder", 30, 100, (0, 0, 50)),
        frustum(30, 12, 100, 130),
        rod("cylinder", 12, 25, (0, 0, 142)),
    ]
    return Declared(
        parts, 160, 0.5, (0.30, 0.55, 0.75), "half-full 0.25 l drink bottle, 60 x 154.5 mm; 160 g", rolls=True
    )


def can() -> Declared:
    """Food can, standing."""
    return Declared(
        [rod("cylinder", 33, 60)], 180, 0.4, (0.70, 0.30, 0.25), "small food can, 66 x 60 mm; 180 g"
    )


def soap() -> Declared:
    """Bar of soap."""
    a, b = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, 9), np.arange(20) * np.pi / 10)
    shape = np.column_stack(
        [
            42 * _signed_power(np.cos(a.ravel()), 0.5) * _signed_power(np.cos(b.ravel()), 0.6),
            27 * _signed_power(np.cos(a.ravel()), 0.5) * _signed_power(np.sin(b.ravel()), 0.6),
            14 * _signed_power(np.sin(a.ravel()), 0.7),
        ]
    )
    return Declared(
        [hull(shape)], 100, 0.45, (0.90, 0.78, 0.74), "bar of soap, 84 x 54 x 28 mm superellipsoid; 100 g"
    )


def banana() -> Declared:
    """Banana lying on its side."""
    t = np.linspace(-0.85, 0.85, 15)
    centres = 95 * np.column_stack([np.sin(t), np.cos(t)])
    radii = 17 * np.sqrt(np.clip(1 - (t / 0.98) ** 4, 0.05, 1))
    return Declared(
        tube(centres, radii),
        120,
        0.6,
        (0.92, 0.80, 0.22),
        "banana, an arc of 95 mm radius, 34 mm thick; 120 g",
        True,
    )


def screwdriver() -> Declared:
    """Screwdriver."""
    parts = [
        rod("cylinder", 13, 75, (-50, 0, 0), "x"),
        rod("cylinder", 15, 18, (-80, 0, 0), "x"),
        rod("cylinder", 3, 90, (30, 0, 0), "x"),
    ]
    return Declared(
        parts, 75, 0.6, (0.85, 0.45, 0.10), "screwdriver, handle 26 to 30 mm, shaft 6 mm, 164 mm long; 75 g"
    )


def tape_roll() -> Declared:
    """Roll of packing tape, lying."""
    return Declared(
        ring((25, 25), (34, 34), -12, 12, 16),
        45,
        0.6,
        (0.75, 0.65, 0.45),
        "roll of packing tape, 68 x 50 x 24 mm; 45 g",
        True,
    )


def carton() -> Declared:
    """Carton of tea bags."""
    return Declared(
        [box(95, 62, 38)], 70, 0.5, (0.45, 0.60, 0.40), "carton of tea bags, 95 x 62 x 38 mm; 70 g"
    )


def brush() -> Declared:
    """Nail brush."""
    back = hull(
        [
            (x, y * w, z)
            for x, w in ((-45, 14), (-35, 21), (35, 21), (45, 14))
            for y in (-1, 1)
            for z in (16, 26)
        ]
    )
    return Declared(
        [back, box(80, 36, 16, (0, 0, 8)), box(60, 10, 8, (0, 0, 30))],
        65,
        0.6,
        (0.60, 0.42, 0.28),
        "nail brush, 90 x 42 x 34 mm; 65 g",
    )


def bowl() -> Declared:
    """Small bowl."""
    parts = [
        frustum(24, 26, 0, 5),
        *ring((20, 40), (26, 44), 3, 24, 16),
        *ring((40, 47), (44, 51), 24, 45, 16),
    ]
    return Declared(parts, 150, 0.5, (0.55, 0.68, 0.72), "small bowl, 102 x 45 mm, wall 4 mm; 150 g")


def _signed_power(values: np.ndarray, power: float) -> np.ndarray:
    """Power of the absolute values, with their signs."""
    return np.asarray(np.sign(values) * np.abs(values) ** power)
