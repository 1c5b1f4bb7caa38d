"""The world: table, cloth, objects at rest and the robot, as a function of settings and a seed."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
