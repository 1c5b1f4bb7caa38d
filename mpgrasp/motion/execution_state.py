"""State of one execution: the grasp, the driver, and what was found so far; the phases share it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.linear_algebra import norm
from mpgrasp.motion.driver import Driver
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.robot import hand


class ExecutionState:
    """State that the phases of one execution share: the grasp, the driver, and what was found so far.

    Args:
        driver: moves the hand.
        grasp: what to grasp.
        config: speeds, forces, times and heights.
        yaw: heading of the hand's x axis [rad].
        on_tick: is told the phase on every tick of the velocity loop.
        rng: source of the noise on forces; one of a fixed seed by default.
    """

    def __init__(
        self,
        driver: Driver,
        grasp: Grasp,
        config: ExecutionConfig,
        *,
        yaw: float,
        on_tick: Callable[[str], None] | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        self.driver, self.grasp, self.config, self.yaw = driver, grasp, config, yaw
        self.simulation = driver.simulation
        self.phase = ""
        """Name of the phase that is played; empty before the first."""
        self.start = self.simulation.time
        """Simulated time at which it began [s]."""
        self.rest = {name: self.height_of(name) for name in self.simulation.scene.objects}
        """Height of each object at rest, by name [m]."""
        self.planned = config.planned_height(grasp)
        """Height of the finger tips over the table that is aimed at [m]."""
        self.contact_height: float | None = None
        """Height of the finger tips over the table at first contact [m]."""
        self.tip_height = np.nan
        """Height of the finger tips over the table when they closed [m]."""
        self.between: tuple[str, ...] = ()
        """Objects that the fingers clamped when the lift began."""
        self.width = np.nan
        """Opening of the gripper when the lift began [m]."""
        self._on_tick = on_tick
        self._rng = np.random.default_rng(0) if rng is None else rng

    def play(self, phases: Mapping[str, Phase]) -> None:
        """Play phases in order, up to a protective stop."""
        for name, phase in phases.items():
            self.phase = name
            phase(self)
            if self.driver.reflex is not None:
                break

    def pose(self, z: float) -> FloatArray:
        """Pose (4, 4) of the tool over the grasp at a height [m]."""
        return looking_down([self.grasp.position[0], self.grasp.position[1], z], self.yaw)

    def move(self, target: FloatArray, speed: float, until: Callable[[], bool] | None = None) -> bool:
        """Move to a pose (4, 4) at a speed [m/s]; False if `until` or a protective stop cut it short."""
        return self.driver.move_to(
            target, speed, until=until, deceleration=self.config.contact_deceleration, on_tick=self.tick
        )

    def rise(self, height: float, speed: float) -> None:
        """Move up by a height [m] at a speed [m/s]."""
        target = self.driver.T_desired.copy()
        target[2, 3] += height
        self.move(target, speed)

    def tick(self, _: Driver) -> None:
        """Tell the phase to whoever asked for it."""
        if self._on_tick is not None:
            self._on_tick(self.phase)

    def felt(self) -> float:
        """External force over the last tick as the robot feels it [N]; noise is drawn anew at each call."""
        force, noise = self.driver.touch, self.config.force_noise
        if noise == 0:
            return force
        # alike in all directions, so that of the force its length is enough
        return norm(self._rng.normal(0.0, noise, 3) + np.array([force, 0.0, 0.0]))

    def tip(self) -> float:
        """Height of the finger tips over the table [m]."""
        return float(self.simulation.T_world_tcp[2, 3]) - hand.FINGERTIP_BEYOND_TCP

    def height_of(self, name: str) -> float:
        """Height of an object's frame over the table [m]."""
        return float(self.simulation.object_pose(name)[2, 3])


Phase = Callable[[ExecutionState], None]
"""One step of an execution: moves the hand, and notes in the state what it found."""
