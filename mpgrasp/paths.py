"""Where assets, scenes, benchmark declarations and weights lie: in the checkout or in the wheel."""

from __future__ import annotations

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
