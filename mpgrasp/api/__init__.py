"""Python first: suites, episodes and scenes by one call each, for scripts and notebooks.

`mpgrasp.evaluate(...)`, `mpgrasp.episode(...)` and `mpgrasp.scene(...)` are these functions.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
