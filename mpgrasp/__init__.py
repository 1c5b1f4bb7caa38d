"""Closed-loop robotic grasping in simulation: detectors and controllers on a Franka Panda in MuJoCo.

The pipeline, one control tick:

    scene --MjModel--> camera --DepthFrame--> detector --GraspMap--> grid_map --GridMap--> entropy
    --utility--> controller --Command(twist, gripper)--> ik --dq--> panda;  episode loops it for bench

Names below are loaded when they are first used: importing mpgrasp loads neither MuJoCo nor torch nor GL.
"""

from __future__ import annotations

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
