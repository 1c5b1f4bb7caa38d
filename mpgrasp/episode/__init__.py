"""Episodes: one grasp, or a table to be cleared, from the first look to the verdict of physics."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
