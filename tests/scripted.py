"""A detector that sees nothing and a controller that does what it was told beforehand."""

from __future__ import annotations

import numpy as np

from mpgrasp.controllers.controller import Command, Observation
from mpgrasp.depth import DepthFrame
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.height_map import HeightMap


class Blind:
    """A detector that never sees a grasp."""

    name = "blind"

    def reset(self, truth: HeightMap | None) -> None:
        self.truth = truth

    def predict(self, frame: DepthFrame) -> GraspMap:
        nothing = np.zeros(frame.depth.shape, np.float32)
        return GraspMap(
            quality=nothing,
            angle=nothing,
            width=nothing,
            depth=frame.depth,
            intrinsics=frame.intrinsics,
            T_world_camera=frame.T_world_camera,
            time=frame.time,
        )


class Scripted:
    """A controller with one twist for ever, and a grasp chosen in advance."""

    name = "scripted"

    def __init__(self, twist: tuple[float, ...], *, ticks: int = 1000, grasp: Grasp | None = None) -> None:
        self.twist, self.ticks, self.grasp = np.array(twist), ticks, grasp
        self.count = 0

    def reset(self, seed: int) -> None:
        self.count = 0

    def update(self, observation: Observation) -> Command:
        self.count += 1
        return Command(twist=self.twist, gripper=0.08, done=self.count > self.ticks)

    def final_grasp(self) -> Grasp | None:
        return self.grasp

    def diagnostics(self) -> dict[str, float]:
        return {}
