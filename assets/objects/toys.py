"""The set of toys; millimetres and grams."""

from __future__ import annotations

import numpy as np
from shapes import Declared, box, extruded, frustum, loft, rod


def toy_car() -> Declared:
    """Car on fixed wheels."""
    body = loft(
        [
            (-37, [(15, 9), (15, 18)]),
            (-35, [(17, 7), (15, 21)]),
            (35, [(17, 7), (15, 18)]),
            (38, [(14, 9), (13, 14)]),
        ]
    )
    cabin = loft([(-28, [(14, 19)]), (-21, [(12, 33)]), (6, [(12, 33)]), (18, [(14, 18)])])
    wheels = [rod("cylinder", 8, 7, (x, y, 8), axis="y") for x in (-22, 23) for y in (-15, 15)]
    return Declared(
        [body, cabin, *wheels], 48, 0.6, (0.80, 0.20, 0.12), "toy car, 75 x 37 x 33 mm, wheels fixed; 48 g"
    )


def toy_dinosaur() -> Declared:
    """Dinosaur cut from a board."""
    outline = [
        (-22, 0), (-9, 0), (-8, 13), (6, 13), (7, 0), (20, 0), (21, 20), (28, 33), (32, 43), (41, 44),
        (43, 50), (38, 57), (28, 57), (20, 48), (13, 37), (0, 40), (-14, 36), (-27, 24), (-41, 14),
        (-43, 9), (-31, 12), (-23, 16),
    ]  # fmt: skip
    return Declared(
        extruded(outline, 26),
        38,
        0.6,
        (0.25, 0.52, 0.24),
        "wooden dinosaur cut from a 26 mm board, 86 x 26 x 57 mm; 38 g",
    )


def toy_rocket() -> Declared:
    """Rocket standing on its fins."""
    fins = [
        box(15, 4, 22, (19 * np.cos(a), 19 * np.sin(a), 11), float(a))
        for a in np.pi / 4 + np.arange(4) * np.pi / 2
    ]
    return Declared(
        [frustum(12, 17, 4, 20), frustum(17, 15, 20, 52), frustum(15, 3, 52, 78), *fins],
        42,
        0.6,
        (0.85, 0.85, 0.88),
        "toy rocket standing on four fins, 78 mm high; 42 g",
    )


def toy_boat() -> Declared:
    """Tugboat."""
    bottom = loft(
        [
            (-38, [(13, 4), (15, 22)]),
            (-34, [(10, 0)]),
            (18, [(10, 0)]),
            (20, [(17, 22)]),
            (36, [(5, 14)]),
            (46, [(1.5, 24)]),
        ]
    )
    return Declared(
        [bottom, box(30, 22, 16, (-12, 0, 29)), rod("cylinder", 6, 16, (-14, 0, 43))],
        52,
        0.6,
        (0.15, 0.35, 0.65),
        "toy tugboat, 84 x 34 x 51 mm; 52 g",
    )
