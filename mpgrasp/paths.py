"""Where assets, scenes, benchmarks and weights lie, in the checkout or in the wheel, and where the cache is.

The cache folder follows https://specifications.freedesktop.org/basedir-spec/latest/.
"""

from __future__ import annotations

import os
from pathlib import Path

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
    """Folder for what can be made again; it need not exist, nor be writable. None without a home.

    $MPGRASP_CACHE, else mpgrasp/ in $XDG_CACHE_HOME, else ~/.cache/mpgrasp.
    """
    if own := os.environ.get("MPGRASP_CACHE"):
        return Path(own).expanduser().absolute()
    shared = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if shared.is_absolute():
        return shared / "mpgrasp"
    try:
        return Path.home() / ".cache" / "mpgrasp"
    except RuntimeError:
        return None
