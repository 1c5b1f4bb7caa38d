"""Objects that a URDF describes: one rigid body with one mesh, its scale, mass and friction.

Reference: http://wiki.ros.org/urdf/XML; friction as PyBullet has it, `<contact><lateral_friction>`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mpgrasp.bench.meshes.facts import NOTHING_KNOWN, ObjectFacts
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.regular import read_regular

URDF = ".urdf"
_LARGEST = 4.0  # [MB]
_PACKAGE, _FILE = "package://", "file://"


@dataclass(frozen=True, kw_only=True)
class UrdfObject:
    """What a URDF says of an object."""

    mesh: Path
    """File of its shape: that of collisions, or of pictures where there is no other."""
    scale: float
    """Unit of the numbers in that file [m]."""
    facts: ObjectFacts
    """Mass and friction, where it tells them."""


def read_urdf(path: Path) -> UrdfObject:
    """Return what a URDF says of an object. Where the mesh stands on its body does not matter here.

    Raises:
        ConfigError: no URDF, or none of one body with one mesh, or a number that cannot be.
    """
    try:
        root = ET.fromstring(read_regular(path, _LARGEST))
    except (OSError, ET.ParseError) as error:
        raise ConfigError(f"a URDF cannot be read ({error})", got=str(path), allowed="XML") from error
    meshes = _meshes(root, "collision") or _meshes(root, "visual")
    bodies = {link for link, _ in meshes}
    files = {(mesh.get("filename", ""), mesh.get("scale", "1 1 1")) for _, mesh in meshes}
    if len(bodies) != 1 or len(files) != 1:
        raise ConfigError(
            "a URDF that is not one body with one mesh",
            got=f"{path.name}: {len(bodies)} bodies with meshes, {len(files)} meshes",
            allowed="one each; export others as a mesh",
        )
    ((name, scale),), (body,) = files, bodies
    (link,) = (item for item in root.iter("link") if item.get("name", "") == body)
    return UrdfObject(mesh=_found(path, name), scale=_scale(path, scale), facts=_facts(path, link))


def _meshes(root: ET.Element, kind: str) -> list[tuple[str, ET.Element]]:
    """Name of the body, and mesh, of all meshes of a kind."""
    return [
        (link.get("name", ""), mesh)
        for link in root.iter("link")
        for shape in link.findall(kind)
        for mesh in shape.iter("mesh")
    ]


def _found(path: Path, name: str) -> Path:
    """File of a mesh: beside the URDF, or in the package that it lies in."""
    folders = [path.parent, *path.parent.parents][:4]
    word = name.removeprefix(_FILE)
    tries = [folder / word for folder in folders[:1]]
    if name.startswith(_PACKAGE):
        package, _, rest = name.removeprefix(_PACKAGE).partition("/")
        tries = [folder / part for folder in folders for part in (rest, f"{package}/{rest}")]
    for file in tries:
        if word and file.is_file():
            return file
    raise ConfigError("the mesh of a URDF is not there", got=name, allowed=f"a file beside {path.name}")


def _scale(path: Path, text: str) -> float:
    numbers = _numbers(text)
    if len(numbers) != 3 or not (numbers[0] > 0 and np.ptp(numbers) <= 1e-6 * numbers[0]):
        raise ConfigError(f"{path.name}: a mesh scaled unevenly", got=text, allowed="three equal numbers")
    return numbers[0]


def _facts(path: Path, link: ET.Element) -> ObjectFacts:
    told: dict[str, float] = {}
    for key, where in (("mass", "inertial/mass"), ("friction", "contact/lateral_friction")):
        element = link.find(where)
        if element is not None:
            numbers = _numbers(element.get("value", ""))
            if len(numbers) != 1:
                raise ConfigError(f"{path.name}: {key} is no number", got=element.get("value"))
            told[key] = numbers[0]
    try:
        return ObjectFacts(**told) if told else NOTHING_KNOWN
    except ConfigError as error:
        raise ConfigError(f"{path.name}: {error}") from error


def _numbers(text: str) -> list[float]:
    """Finite numbers of a text; none where one is not."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return []
    return numbers if np.isfinite(numbers).all() else []
