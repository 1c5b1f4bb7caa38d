"""Interface of what moves the robot's hand through a scene, with the arm or without it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, Self

from mpgrasp.geometry import FloatArray
from mpgrasp.motion.reflex import Reflex
from mpgrasp.scene.moving_scene import MovingScene


class Driver(Protocol):
    """Mover of the hand: `ArmDriver` carries it by the arm, `HandDriver` lets it fly.

    A protective stop ends the motion at once, and later motions do not move. `on_tick` is called with the
    driver after every tick of the velocity loop.
    """

    @property
    def simulation(self) -> MovingScene:
        """Scene in which the hand moves."""

    @property
    def reflex(self) -> Reflex | None:
        """Protective stop that ended the motion, if any."""

    @property
    def touch(self) -> float:
        """External force over the last tick [N]."""

    @property
    def T_desired(self) -> FloatArray:
        """Pose (4, 4) at which the tool point should be."""

    def move_to(
        self,
        T_world_tcp: FloatArray,
        max_speed: float,
        *,
        until: Callable[[], bool] | None = None,
        deceleration: float | None = None,
        on_tick: Callable[[Self], None] | None = None,
    ) -> bool:
        """Move in a straight line to a pose (4, 4) at `max_speed` [m/s] at most, and come to rest.

        Returns:
            True if the pose was reached, False if `until` (which brakes with `deceleration` [m/s2]) or a
            protective stop cut the move short.
        """

    def wait(
        self,
        duration: float,
        on_tick: Callable[[Self], None] | None = None,
        *,
        until: Callable[[], bool] | None = None,
    ) -> object:
        """Stand still for a time [s], or until something holds."""

    def follow(
        self,
        path: Callable[[float], FloatArray],
        duration: float,
        on_tick: Callable[[Self], None] | None = None,
    ) -> object:
        """Follow offsets (3,) [m] of the tool point as a function of time [s], zero at both ends."""
