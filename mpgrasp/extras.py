"""Libraries that not every user needs, and the extra of this package that brings each of them."""

from __future__ import annotations

import importlib.util

from mpgrasp.exceptions import ConfigError

EXTRAS = {
    "torch": "torch",
    "rerun": "rerun",
    "trimesh": "objects",
    "coacd": "objects",
    "fast_simplification": "objects",
    "h5py": "export",
    "pyarrow": "export",
    "ray": "ray",
    "stable_baselines3": "sb3",
    "moviepy": "video",
}
"""Name of the extra by the name that a library is imported by."""


def is_installed(library: str) -> bool:
    """True if a library can be imported; does not import it."""
    return importlib.util.find_spec(library) is not None


def check_installed(library: str, what: str) -> None:
    """Raise ConfigError, which names the extra to install, unless a library is there.

    Args:
        library: a key of `EXTRAS`.
        what: what needs it: "--record".
    """
    if not is_installed(library):
        raise not_installed(library, what)


def not_installed(library: str, what: str) -> ConfigError:
    """Return the error of something that needs a library of `EXTRAS`, where there is none."""
    return ConfigError(
        f"{what} needs {library}, which is not installed",
        allowed=f"pip install 'mpgrasp[{EXTRAS[library]}]'",
    )


def missing_library(error: ModuleNotFoundError) -> str | None:
    """Return the library of `EXTRAS` whose import failed; None if it was another one."""
    library = (error.name or "").partition(".")[0]
    return library if library in EXTRAS else None
