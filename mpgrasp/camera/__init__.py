"""The wrist camera: rasterised through OpenGL or cast by rays, with the noise of a real one."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
