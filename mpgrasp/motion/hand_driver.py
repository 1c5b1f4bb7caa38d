"""Motion of the hand without its arm, as the arm would move it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import norm
from mpgrasp.motion.arm_driver import FORCE_WINDOW
from mpgrasp.motion.reflex import Reflex, ReflexConfig
from mpgrasp.motion.trajectory import MotionConfig, path_profile
from mpgrasp.scene.free_hand import FreeHand

OnTick = Callable[["HandDriver"], None]


class HandDriver:
    """Moves the hand as `ArmDriver` moves the arm, with the same profiles and the same stop on force."""

    def __init__(self, hand: FreeHand) -> None:
        self.simulation = hand
        self.config = MotionConfig()
        self.bounds = ReflexConfig()
        self.reflex: Reflex | None = None
        self._steps = round(self.config.dt / hand.model.opt.timestep)
        self._forces: deque[FloatArray] = deque([np.zeros(3)] * FORCE_WINDOW, maxlen=FORCE_WINDOW)

    @property
    def T_desired(self) -> FloatArray:
        """Pose (4, 4) at which the tool point should be."""
        return self.simulation.T_desired

    @property
    def touch(self) -> float:
        """External force on the hand over the last tick [N]."""
        return norm(self._forces[-1])

    def move_to(
        self,
        T_world_tcp: FloatArray,
        max_speed: float,
        *,
        until: Callable[[], bool] | None = None,
        deceleration: float | None = None,
        on_tick: OnTick | None = None,
    ) -> bool:
        """Move in a straight line, without turning; as `ArmDriver.move_to`."""
        c = self.config
        start = self.T_desired[:3, 3]
        way = T_world_tcp[:3, 3] - start
        done = 0.0
        for share in path_profile(norm(way), 0.0, c, max_speed, c.max_rotation):
            self._tick(start + share * way, on_tick)
            if self.reflex is not None:
                return False
            if until is not None and until():
                self._brake(way * (share - done) / c.dt, deceleration or c.linear_acceleration, on_tick)
                return False
            done = share
        return True

    def wait(
        self, duration: float, on_tick: OnTick | None = None, *, until: Callable[[], bool] | None = None
    ) -> None:
        """Stand still for a time [s], or until something holds."""
        here = self.T_desired[:3, 3]
        for _ in range(round(duration / self.config.dt)):
            if self.reflex is not None or (until is not None and until()):
                break
            self._tick(here, on_tick)

    def follow(
        self, path: Callable[[float], FloatArray], duration: float, on_tick: OnTick | None = None
    ) -> None:
        """Follow offsets (3,) [m] of the tool point as a function of time [s]."""
        start = self.T_desired[:3, 3]
        for k in range(1, round(duration / self.config.dt) + 1):
            if self.reflex is not None:
                break
            self._tick(start + path(k * self.config.dt), on_tick)

    def _brake(self, velocity: FloatArray, deceleration: float, on_tick: OnTick | None) -> None:
        dt = self.config.dt
        speed = norm(velocity)
        while speed > 0 and self.reflex is None:
            slower = max(0.0, speed - deceleration * dt)
            velocity, speed = velocity * (slower / speed), slower
            self._tick(self.T_desired[:3, 3] + velocity * dt, on_tick)

    def _tick(self, target: FloatArray, on_tick: OnTick | None) -> None:
        hand, b = self.simulation, self.bounds
        hand.step(target, self._steps)
        self._forces.append(hand.external_force)
        force = norm(sum(self._forces)) / FORCE_WINDOW
        for limit, value, bound in (
            ("contact_force", force, b.contact_force),
            ("tracking_position", hand.lag, b.tracking_position),
        ):
            if value > bound:
                self.reflex = Reflex(limit=limit, joint=None, value=value, bound=bound, time=hand.time)
        if on_tick is not None:
            on_tick(self)
