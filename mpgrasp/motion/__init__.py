"""Motion of the arm: inverse kinematics, protective stops, and the execution of a grasp."""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
