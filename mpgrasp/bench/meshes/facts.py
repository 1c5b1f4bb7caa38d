"""What is known of objects beside their meshes: `objects.toml` in a folder of them.

[mug]
mass = 0.31        # kg; or density = 700, kg/m^3
friction = 0.45    # sliding friction coefficient
scale = 0.001      # unit of the numbers in its file [m]
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from mpgrasp.exceptions import ConfigError
from mpgrasp.files.regular import read_regular
from mpgrasp.files.settings import from_table

FILE = "objects.toml"
"""Name of the file, beside meshes or beside the folders of objects."""
MASSES = (0.001, 20.0)
"""Least and greatest mass that an object may have [kg]; the hand holds far less than the latter."""
FRICTIONS = (0.05, 3.0)
"""Least and greatest sliding friction coefficient."""

_LARGEST = 4.0  # [MB]


@dataclass(frozen=True, kw_only=True)
class ObjectFacts:
    """Facts of one object; None: as for all others."""

    mass: float | None = None
    """[kg]"""
    density: float | None = None
    """[kg/m^3]; in the place of a mass."""
    friction: float | None = None
    """Sliding friction coefficient."""
    scale: float | None = None
    """Unit of the numbers in its file [m]."""

    def __post_init__(self) -> None:
        for name, (low, high) in {"mass": MASSES, "friction": FRICTIONS, "scale": (1e-6, 1000.0)}.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ConfigError(f"{name} out of range", got=value, allowed=f"{low:g} to {high:g}")
        if self.density is not None:
            from mpgrasp.scene.objects.model import check_density

            check_density(self.density)
            if self.mass is not None:
                raise ConfigError(
                    "a mass and a density", got=(self.mass, self.density), allowed="one of them"
                )

    def overridden(self, by: ObjectFacts | None) -> ObjectFacts:
        """Return these facts with others in their place where those tell something; a density ends a mass."""
        if by is None:
            return self
        told = {name: value for name, value in asdict(by).items() if value is not None}
        own = {name: None for name in ("mass", "density") if {"mass", "density"} & set(told)}
        return replace(self, **{**own, **told})


NOTHING_KNOWN = ObjectFacts()


def read_facts(folder: Path, names: Iterable[str]) -> Mapping[str, ObjectFacts]:
    """Return the facts of a folder's objects by name.

    Args:
        folder: of meshes, or of folders of objects, with the file.
        names: of the objects in it.

    Raises:
        ConfigError: a file that cannot be read, a key or value that cannot be, or an object that is absent.
    """
    path = folder / FILE
    try:
        declared = tomllib.loads(read_regular(path, _LARGEST).decode("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"{FILE} of objects cannot be read: {error}", got=str(path)) from error
    known = sorted(names)
    for name in declared:
        if name not in known:
            raise ConfigError(f"{FILE} tells of an object that is not beside it", got=name, allowed=known)
    return {
        name: from_table(ObjectFacts, table, f"{path.name}, [{name}]") for name, table in declared.items()
    }
