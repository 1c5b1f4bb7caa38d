"""Write the catalogue of evaluation objects: objects.toml and one OBJ of convex pieces where primitives will not do.

    python assets/objects/generate.py

Lengths in this file are millimetres, masses grams; what it writes is in metres and kilograms. Running it again gives
the same files. Shapes are drawn here from everyday dimensions; nothing is scanned, copied or downloaded.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from shapes import box, extruded, frustum, hull, loft, ring, rod, tube

from mpgrasp.object_model import ObjectModel, Part
from mpgrasp.objects import OBJECT_SETS

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Declared:
    """One object before it is written."""

    parts: list[Part]
    grams: float
    friction: float
    rgba: tuple[float, float, float]
    provenance: str
    rolls: bool = False


# --- thin --------------------------------------------------------------------------------------------------------------


def usb_stick() -> Declared:
    return Declared(
        [box(44, 18, 8), box(14, 12, 4.5, (29, 0, 0))],
        10,
        0.6,
        (0.16, 0.17, 0.20),
        "USB-A flash drive: plug 12 x 4.5 mm as in the USB 2.0 specification, body 44 x 18 x 8 mm; 10 g",
    )


def key() -> Declared:
    bow = ring((4, 4), (13, 13), -2.5, 2.5)
    return Declared(
        [*bow, box(34, 8, 2.4, (28.5, 0, 0)), box(16, 3, 2.4, (35, -5, 0))],
        14,
        0.5,
        (0.72, 0.70, 0.62),
        "door key with a plastic bow of 26 x 5 mm, blade 2.4 mm thick; 14 g",
    )


def ruler() -> Declared:
    return Declared(
        [box(200, 28, 3)],
        12,
        0.5,
        (0.80, 0.66, 0.42),
        "wooden school ruler, 200 x 28 x 3 mm, 700 kg/m3; 12 g",
    )


def pen() -> Declared:
    parts = [rod("cylinder", 5, 122, axis="x"), box(38, 2.5, 2.5, (-38, 0, 6.0))]
    tip = np.array(
        [(x, r * np.cos(a), r * np.sin(a)) for x, r in ((61, 5), (75, 1)) for a in np.arange(16) * np.pi / 8]
    )
    return Declared(
        [*parts, hull(tip)],
        11,
        0.5,
        (0.10, 0.16, 0.42),
        "ballpoint pen, 136 x 10 mm with clip; 11 g",
        rolls=True,
    )


def card_stack() -> Declared:
    return Declared(
        [box(85.6, 54, 6.1)],
        41,
        0.5,
        (0.82, 0.80, 0.86),
        "eight ISO/IEC 7810 ID-1 cards, 85.6 x 54 x 0.76 mm each, banded to one block; 41 g",
    )


def washer() -> Declared:
    return Declared(
        ring((10.5, 10.5), (18.5, 18.5), -1.5, 1.5),
        17,
        0.5,
        (0.62, 0.63, 0.65),
        "M20 washer as in ISO 7089: 37 x 21 x 3 mm steel; 17 g",
    )


def plate_brick() -> Declared:
    studs = [rod("cylinder", 2.4, 1.7, (x, y, 2.45)) for x in (-12, -4, 4, 12) for y in (-4, 4)]
    return Declared(
        [box(31.8, 15.8, 3.2), *studs],
        2.2,
        0.6,
        (0.78, 0.12, 0.10),
        "2 x 4 toy brick plate, pitch 8 mm, 3.2 mm + studs; 2.2 g",
    )


# --- toys --------------------------------------------------------------------------------------------------------------


def toy_car() -> Declared:
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
    outline = [
        (-22, 0), (-9, 0), (-8, 13), (6, 13), (7, 0), (20, 0), (21, 20), (28, 33), (32, 43), (41, 44), (43, 50),
        (38, 57), (28, 57), (20, 48), (13, 37), (0, 40), (-14, 36), (-27, 24), (-41, 14), (-43, 9), (-31, 12), (-23, 16),
    ]  # fmt: skip
    return Declared(
        extruded(outline, 26),
        38,
        0.6,
        (0.25, 0.52, 0.24),
        "wooden dinosaur cut from a 26 mm board, 86 x 26 x 57 mm; 38 g",
    )


def toy_rocket() -> Declared:
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


# --- household ---------------------------------------------------------------------------------------------------------


def mug() -> Declared:
    handle = [box(20, 9, 8, (38, 0, 52)), box(20, 9, 8, (38, 0, 20)), box(8, 9, 40, (46, 0, 36))]
    return Declared(
        [*ring((26, 28), (30, 32), 4, 70, 16), frustum(30, 30.2, 0, 5), *handle],
        190,
        0.5,
        (0.86, 0.84, 0.78),
        "small stoneware mug, 64 mm across, 70 mm high; 190 g",
    )


def bottle() -> Declared:
    parts = [
        rod("cylinder", 30, 100, (0, 0, 50)),
        frustum(30, 12, 100, 130),
        rod("cylinder", 12, 25, (0, 0, 142)),
    ]
    return Declared(
        parts, 160, 0.5, (0.30, 0.55, 0.75), "half-full 0.25 l drink bottle, 60 x 154.5 mm; 160 g", rolls=True
    )


def can() -> Declared:
    return Declared(
        [rod("cylinder", 33, 60)], 180, 0.4, (0.70, 0.30, 0.25), "small food can, 66 x 60 mm; 180 g"
    )


def soap() -> Declared:
    a, b = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, 9), np.arange(20) * np.pi / 10)
    sign = lambda v, p: np.sign(v) * np.abs(v) ** p  # noqa: E731
    shape = np.column_stack(
        [
            42 * sign(np.cos(a.ravel()), 0.5) * sign(np.cos(b.ravel()), 0.6),
            27 * sign(np.cos(a.ravel()), 0.5) * sign(np.sin(b.ravel()), 0.6),
            14 * sign(np.sin(a.ravel()), 0.7),
        ]
    )
    return Declared(
        [hull(shape)], 100, 0.45, (0.90, 0.78, 0.74), "bar of soap, 84 x 54 x 28 mm superellipsoid; 100 g"
    )


def banana() -> Declared:
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
    parts = [
        rod("cylinder", 13, 75, (-50, 0, 0), "x"),
        rod("cylinder", 15, 18, (-80, 0, 0), "x"),
        rod("cylinder", 3, 90, (30, 0, 0), "x"),
    ]
    return Declared(
        parts, 75, 0.6, (0.85, 0.45, 0.10), "screwdriver, handle 26 to 30 mm, shaft 6 mm, 164 mm long; 75 g"
    )


def tape_roll() -> Declared:
    return Declared(
        ring((25, 25), (34, 34), -12, 12, 16),
        45,
        0.6,
        (0.75, 0.65, 0.45),
        "roll of packing tape, 68 x 50 x 24 mm; 45 g",
        True,
    )


def carton() -> Declared:
    return Declared(
        [box(95, 62, 38)], 70, 0.5, (0.45, 0.60, 0.40), "carton of tea bags, 95 x 62 x 38 mm; 70 g"
    )


def brush() -> Declared:
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
    parts = [
        frustum(24, 26, 0, 5),
        *ring((20, 40), (26, 44), 3, 24, 16),
        *ring((40, 47), (44, 51), 24, 45, 16),
    ]
    return Declared(parts, 150, 0.5, (0.55, 0.68, 0.72), "small bowl, 102 x 45 mm, wall 4 mm; 150 g")


CATALOGUE = {
    **{f.__name__: f for f in (usb_stick, key, ruler, pen, card_stack, washer, plate_brick)},
    **{f.__name__: f for f in (toy_car, toy_dinosaur, toy_rocket, toy_boat)},
    **{f.__name__: f for f in (mug, bottle, can, soap, banana, screwdriver, tape_roll)},
    **{"box": carton, "brush": brush, "bowl": bowl},
}


# --- writing -----------------------------------------------------------------------------------------------------------


def centred(parts: list[Part]) -> list[Part]:
    """Parts with the origin at the bounding box's centre."""
    points = np.vstack([part.points for part in parts])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    moved = []
    for part in parts:
        if part.vertices is not None:
            moved.append(Part(shape="mesh", vertices=part.vertices - centre))
        else:
            position = tuple(float(v) for v in np.array(part.position) - centre)
            moved.append(
                Part(shape=part.shape, size=part.size, position=position, quaternion=part.quaternion)
            )
    return moved


def obj_text(name: str, pieces: list[np.ndarray]) -> str:
    """Wavefront OBJ: one group per convex piece, with its hull's faces wound outwards."""
    lines, first = [f"# {name}: {len(pieces)} convex pieces, metres. Written by generate.py."], 1
    for k, vertices in enumerate(pieces):
        vertices = np.round(vertices, 6)
        shell = ConvexHull(vertices)
        vertices = vertices[shell.vertices]
        shell = ConvexHull(vertices)
        inside = vertices.mean(axis=0)
        lines.append(f"o piece_{k}")
        lines += ["v " + " ".join(f"{c:.6f}" for c in v) for v in vertices]
        for a, b, c in shell.simplices:
            outwards = (
                np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a]) @ (vertices[a] - inside) > 0
            )
            lines.append("f " + " ".join(str(first + i) for i in ((a, b, c) if outwards else (a, c, b))))
        first += len(vertices)
    return "\n".join(lines) + "\n"


def numbers(values: object) -> str:
    """TOML array, rounded to a micrometre."""
    return "[" + ", ".join(repr(round(float(v), 6) + 0.0) for v in values) + "]"  # type: ignore[attr-defined]


def main() -> None:
    toml = [
        "# Catalogue of evaluation objects, metres and kilograms. Written by generate.py: change that, not this."
    ]
    for names in OBJECT_SETS.values():
        for name in names:
            declared = CATALOGUE[name]()
            parts = centred(declared.parts)
            pieces = [part.vertices for part in parts if part.vertices is not None]
            primitives = [part for part in parts if part.vertices is None]
            model = ObjectModel(name=name, parts=tuple(parts), mass=declared.grams * 1e-3)
            toml += [
                "",
                f"[{name}]",
                f"mass = {declared.grams * 1e-3:.6g}",
                f"friction = {declared.friction}",
                f"rgba = {numbers([*declared.rgba, 1.0])}",
                f"rolls = {str(declared.rolls).lower()}",
                f'provenance = "{declared.provenance}"',
            ]
            if pieces:
                (HERE / f"{name}.obj").write_text(obj_text(name, pieces), encoding="utf-8")
                toml.append(f'mesh = "{name}.obj"')
            for part in primitives:
                toml += [
                    f"[[{name}.parts]]",
                    f'shape = "{part.shape}"',
                    f"size = {numbers(part.size)}",
                    f"position = {numbers(part.position)}",
                    f"quaternion = [{', '.join(repr(round(q, 9) + 0.0) for q in part.quaternion)}]",
                ]
            size = " x ".join(f"{1e3 * edge:.1f}" for edge in model.size)
            print(
                f"{name:13s} {size:>22s} mm {declared.grams:6.1f} g {len(primitives):3d} primitives {len(pieces):3d} pieces"
            )
    (HERE / "objects.toml").write_text("\n".join(toml) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
