"""Source of a plug-in as a hash, so that a run is not finished with code that has changed meanwhile."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from types import ModuleType

import mpgrasp
from mpgrasp.plugins import plug_in_class


def source_hash(kind: str, path: str) -> str | None:
    """Return a hash (hex) of the source of the plug-in at an import path; None for a name of the registry.

    It covers the module of the class, and every module below the same folder that this one uses, directly or
    through another one, once it has been imported. What is installed elsewhere has a version instead.

    Args:
        kind: "detector" or "controller".
        path: name of what plays.

    Raises:
        ConfigError: a plug-in that cannot be imported.
    """
    if ":" not in path:
        return None
    module = sys.modules.get(plug_in_class(kind, path).__module__)
    file = module and _file(module)
    if module is None or file is None:
        return None
    # the folder that imports start from
    root = file.parents[module.__name__.count(".") + (file.name == "__init__.py")]
    digest = hashlib.sha256()
    for part in sorted(_files(module, root)):
        digest.update(part.relative_to(root).as_posix().encode() + b"\0" + part.read_bytes())
    return digest.hexdigest()


def _files(module: ModuleType, root: Path) -> set[Path]:
    """Return the files below a folder of a module and of all that it uses."""
    found: set[Path] = set()
    left = [module]
    while left:
        file = _file(item := left.pop())
        if file is not None and file not in found and _is_users(file, root):
            found.add(file)
            left += _used(item)
    return found


def _used(module: ModuleType) -> list[ModuleType]:
    """Return the modules behind the names of a module: those it imports, or imports something from."""
    values = list(vars(module).values())
    names = {getattr(value, "__module__", None) for value in values}
    behind = [sys.modules[name] for name in names if isinstance(name, str) and name in sys.modules]
    return behind + [value for value in values if isinstance(value, ModuleType)]


def _is_users(file: Path, root: Path) -> bool:
    """True for a file below a folder that is neither installed nor one of mpgrasp."""
    installed = {"site-packages", "dist-packages"} & set(file.parts)
    ours = Path(mpgrasp.__file__).resolve().parent
    return file.is_relative_to(root) and not installed and not file.is_relative_to(ours)


def _file(module: ModuleType) -> Path | None:
    """Return the file of a module's source; None for what has none."""
    file = getattr(module, "__file__", None)
    return Path(file).resolve() if file and Path(file).is_file() else None
