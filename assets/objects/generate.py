"""Write the catalogue: objects.toml, and an OBJ of convex pieces wherever primitives will not do.

    python assets/objects/generate.py

Shapes are drawn from everyday dimensions in thin.py, toys.py and household.py (millimetres and grams);
nothing is scanned, copied or downloaded. What is written is in metres and kilograms, and running it
again writes the same files.
"""

from __future__ import annotations

from pathlib import Path

import household
import numpy as np
import thin
import toys
from scipy.spatial import ConvexHull
from shapes import Declared

from mpgrasp.scene.objects.catalogue import OBJECT_SETS
from mpgrasp.scene.objects.model import ObjectModel, Part

HERE = Path(__file__).resolve().parent


def centred(parts: list[Part]) -> list[Part]:
    """Parts with the origin at the bounding box's centre."""
    points = np.vstack([part.points for part in parts])
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    moved = []
    for part in parts:
        if part.vertices is not None:
            moved.append(Part(shape="mesh", vertices=part.vertices - centre))
        else:
            x, y, z = (float(v) for v in np.array(part.position) - centre)
            moved.append(
                Part(shape=part.shape, size=part.size, position=(x, y, z), quaternion=part.quaternion)
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
    """Write everything and print what was written."""
    toml = ["# Evaluation objects, metres and kilograms. Written by generate.py: change that, not this."]
    sources = {"thin": thin, "toys": toys, "household": household}
    for kind, names in OBJECT_SETS.items():
        for name in names:
            declared: Declared = getattr(sources[kind], name)()
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
                f"{name:13s} {size:>22s} mm {declared.grams:6.1f} g"
                f" {len(primitives):3d} primitives {len(pieces):3d} pieces"
            )
    (HERE / "objects.toml").write_text("\n".join(toml) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
