"""Closed-loop robotic grasping in simulation: detectors and controllers on a Franka Panda in MuJoCo.

The pipeline, one control tick:

    scene --MjModel--> camera --DepthFrame--> detector --GraspMap--> grid_map --GridMap--> entropy
    --utility--> controller --Command(twist, gripper)--> ik --dq--> panda;  episode loops it for bench

Names below are loaded when they are first used: importing mpgrasp loads neither MuJoCo nor torch nor GL.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "CameraIntrinsics": "depth",
    "DepthFrame": "depth",
    "DepthNoise": "sensor_noise",
    "Grasp": "grasp",
    "GraspMap": "grasp",
    "HeightMap": "height_map",
    "GridMap": "grid_map",
    "GraspDetector": "detectors.detector",
    "make_detector": "detectors",
    "Command": "controllers.controller",
    "Controller": "controllers.controller",
    "Observation": "controllers.controller",
    "make_controller": "controllers",
    "SceneConfig": "scene",
    "build_scene": "scene",
    "Simulation": "simulation",
    "WristCamera": "camera",
    "EpisodeConfig": "episode",
    "run_episode": "episode",
    "EpisodeResult": "episode_result",
    "Outcome": "episode_result",
    "MpgraspError": "exceptions",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mpgrasp' has no attribute {name!r}")
    return getattr(import_module(f"mpgrasp.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
