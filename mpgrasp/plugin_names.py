"""Names of detectors and controllers as people type them, and what they stand for.

`./my_net.py:MyNet` is a class or a function in a file: its folder joins the import path, and the plug-in is
`my_net:MyNet` from then on. A name that an installed package has registered in the entry-point group
`mpgrasp.detectors` or `mpgrasp.controllers` stands for the object there. `dhrnet@mine.safetensors` is a
network of the registry with other weights, so that several weights of one network can play side by side; it
is called `dhrnet@mine` in results.
"""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from pathlib import Path

from mpgrasp.exceptions import ConfigError

SB3 = "sb3:"
"""In front of the file of a learned policy, in the place of a controller's name (`mpgrasp.policies`)."""
WEIGHTS = "@"
"""Between a network and a file with its weights."""
_FILE = re.compile(r"(?P<file>.+\.py)(?::(?P<attribute>.*))?", re.DOTALL)
_METHOD = re.compile(r"(.+\.py:\w+|[^/@]+@.+|[^/@]+)/([^/]+|.*\.py:\w+)")


def base_name(name: str) -> str:
    """Return the name in the registry that a name with weights begins with; other names as they are."""
    return name.partition(WEIGHTS)[0]


def canonical(kind: str, name: str) -> str:
    """Return `module:attribute` for a plug-in in a file or of an installed package; other names as they are.

    Args:
        kind: "detector" or "controller".
        name: as it was typed.

    Raises:
        ConfigError: no such file, no attribute in the name, or a module of that name is there already.
    """
    found = _FILE.fullmatch(name)
    if found:
        return f"{_module_of(kind, name, Path(found['file']), found['attribute'])}:{found['attribute']}"
    if ":" not in name and name not in _known(kind):
        for entry in entry_points(group=f"mpgrasp.{kind}s"):
            if entry.name == name:
                return entry.value
    return name


def names_of(kind: str, text: str) -> list[str]:
    """Return the canonical names of a list with commas; an empty name stays one.

    Raises:
        ConfigError: as `canonical`.
    """
    return [canonical(kind, name) for name in text.split(",")]


def detectors_of(text: str) -> tuple[list[str], dict[str, Path]]:
    """Return the names of a list of detectors, and the weights of those that bring their own.

    Raises:
        ConfigError: as `canonical`, or two files of one network that have the same name.
    """
    names: list[str] = []
    weights: dict[str, Path] = {}
    for typed in text.split(","):
        network, at, file = typed.partition(WEIGHTS)
        if not at or _FILE.fullmatch(typed):
            names.append(canonical("detector", typed))
            continue
        if not (network and file):
            raise ConfigError("unusable detector with weights", got=typed, allowed="NETWORK@FILE")
        name = f"{network}{WEIGHTS}{Path(file).stem}"
        if name in weights:
            raise ConfigError(
                "two weights files of one name", got=f"{weights[name]} and {file}", allowed="different names"
            )
        names.append(name)
        weights[name] = Path(file)
    return names, weights


def method_of(text: str) -> tuple[str, str]:
    """Return detector and controller of DETECTOR/CONTROLLER as they were typed.

    Raises:
        ConfigError: it is no such text.
    """
    found = _METHOD.fullmatch(text)
    if found is None:
        raise ConfigError("unusable method", got=text, allowed="DETECTOR/CONTROLLER, such as dhrnet/mppc")
    return found[1], found[2]


def _known(kind: str) -> Sequence[str]:
    if kind == "detector":
        from mpgrasp.detectors import DETECTORS

        return tuple(DETECTORS)
    from mpgrasp.controllers import CONTROLLERS

    return tuple(CONTROLLERS)


def _module_of(kind: str, name: str, file: Path, attribute: str | None) -> str:
    """Return the name of a file's module, which can be imported from now on."""
    if not attribute or not attribute.isidentifier():
        raise ConfigError(
            f"{kind} plug-in names no class", got=name, allowed=f"{file}:Class, a class or a function"
        )
    if not file.is_file():
        raise ConfigError(f"no such file of a {kind} plug-in", got=str(file), allowed="a Python file")
    folder, module = str(file.resolve().parent), file.stem
    if not module.isidentifier():
        raise ConfigError(
            f"{kind} plug-in in a file that is no module", got=file.name, allowed="letters, digits and _"
        )
    if folder not in sys.path:
        sys.path.insert(0, folder)
        importlib.invalidate_caches()
    loaded = sys.modules.get(module)
    place = getattr(loaded, "__file__", None) if loaded else getattr(_spec(module), "origin", None)
    if place is None or Path(place).resolve() != file.resolve():
        raise ConfigError(
            f"{kind} plug-in with the name of another module", got=str(file), allowed=f"not {module}.py"
        )
    return module


def _spec(module: str) -> object:
    try:
        return importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
