"""What an execution asks of whatever carries the hand: an arm, or nothing at all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from mpgrasp.geometry import FloatArray
from mpgrasp.motion.reflex import Reflex
from mpgrasp.scene.scene import Scene


class Body(Protocol):
    """What is moved, among the objects of a scene: a `Simulation`, or a hand without an arm."""

    @property
    def scene(self) -> Scene: ...
    @property
    def time(self) -> float: ...
    @property
    def T_world_tcp(self) -> FloatArray: ...
    @property
    def gripper_width(self) -> float: ...
    def open_gripper(self, width: float) -> None: ...
    def close_gripper(self, force: float) -> None: ...
    def pad_contacts(self) -> tuple[set[str], set[str]]: ...
    def object_pose(self, name: str) -> FloatArray: ...


class Driver(Protocol):
    """What moves it: `ArmDriver`, or the drive of a hand without an arm; see there for the methods."""

    @property
    def simulation(self) -> Body: ...
    @property
    def reflex(self) -> Reflex | None: ...
    @property
    def touch(self) -> float: ...
    @property
    def T_desired(self) -> FloatArray: ...
    def move_to(
        self,
        T_world_tcp: FloatArray,
        max_speed: float,
        *,
        until: Callable[[], bool] | None = None,
        deceleration: float | None = None,
        on_tick: Callable[[Any], None] | None = None,
    ) -> bool: ...
    def wait(
        self,
        duration: float,
        on_tick: Callable[[Any], None] | None = None,
        *,
        until: Callable[[], bool] | None = None,
    ) -> object: ...
    def follow(
        self,
        path: Callable[[float], FloatArray],
        duration: float,
        on_tick: Callable[[Any], None] | None = None,
    ) -> object: ...
