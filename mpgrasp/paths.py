"""Folders of assets, scenes, benchmarks and weights, in the checkout or in the wheel, and of the cache."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

_PACKAGE = Path(__file__).resolve().parent
_CHECKOUT = _PACKAGE.parent
# A wheel carries the data folders inside of the package; a checkout has them beside it.
DATA_ROOT = _PACKAGE / "_data" if (_PACKAGE / "_data").is_dir() else _CHECKOUT

ASSETS = DATA_ROOT / "assets"
PANDA_ASSETS = ASSETS / "panda"
OBJECT_ASSETS = ASSETS / "objects"
WEIGHTS = ASSETS / "weights"
SCENES = DATA_ROOT / "scenes"
BENCHMARKS = DATA_ROOT / "benchmarks"


def cache_folder() -> Path | None:
    """Return the folder for what can be made again; it need not exist, nor be writable. None without a home.

    $MPGRASP_CACHE, else mpgrasp/ among the user's caches: in $XDG_CACHE_HOME, else in ~/.cache on Linux.
    """
    if own := os.environ.get("MPGRASP_CACHE"):
        return Path(own).expanduser().absolute()
    try:
        folder = platformdirs.user_cache_path("mpgrasp", appauthor=False)
    except RuntimeError:  # no home
        return None
    return folder if folder.is_absolute() else None
