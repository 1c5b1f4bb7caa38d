"""Closed-loop robotic grasping in simulation: detectors and controllers on a Franka Panda in MuJoCo.

The pipeline, one control tick:

    scene --MjModel--> camera --DepthFrame--> detector --GraspMap--> grid_map --GridMap--> entropy
    --utility--> controller --Command(twist, gripper)--> ik --dq--> panda;  episode loops it for bench

`mpgrasp.evaluate(...)` plays a suite, `mpgrasp.episode(...)` an episode, `mpgrasp.scene(...)` builds a scene;
see `mpgrasp.api`. Names below are loaded when they are first used: importing mpgrasp loads neither MuJoCo
nor torch nor GL.
"""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import Any

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]


class _CallablePackage(ModuleType):
    """A package whose name is also a verb: `mpgrasp.evaluate(...)` beside `python -m mpgrasp.evaluate`."""

    def __call__(self, *arguments: Any, **settings: Any) -> Any:
        # by its name: the packages below know nothing of what stands above them
        api = importlib.import_module("mpgrasp.api")
        return getattr(api, self.__name__.rpartition(".")[2])(*arguments, **settings)


for _name in ("evaluate", "episode", "scene"):
    importlib.import_module(f"mpgrasp.{_name}").__class__ = _CallablePackage
