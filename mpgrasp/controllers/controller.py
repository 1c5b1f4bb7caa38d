"""The protocol of every reaching controller: a view in, a Cartesian velocity out, and in the end a grasp.

`Controller` is what each must have, `ControllerExtras` what it may have besides, each by itself. Nothing else
of a controller is ever called or read.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, GraspMap


@dataclass(frozen=True, kw_only=True, eq=False)
class Observation:
    """Input of a controller on a control tick."""

    time: float
    """Simulated time since the episode began [s]."""
    T_world_tcp: FloatArray
    """(4, 4) measured pose of the tool point."""
    grasp_map: GraspMap
    """The detector's view of this tick, with its camera pose."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Command:
    """Output of a controller: the robot's motion until the next tick."""

    twist: FloatArray
    """(6,) velocity of the tcp in world axes: linear [m/s], then angular [rad/s]."""
    gripper: float
    """Opening of the gripper [m]."""
    done: bool = False
    """The reach is over: take `Controller.final_grasp`."""


class Controller(Protocol):
    """Steers the wrist camera while the hand comes down from z_max to z_min."""

    name: str

    def reset(self, seed: int) -> None:
        """Forget the last episode; `seed` feeds whatever is random in the controller."""
        ...

    def update(self, observation: Observation) -> Command:
        """Fuse one view and return the next motion."""
        ...

    def final_grasp(self) -> Grasp | None:
        """Return the grasp to execute, or None where no grasp was seen."""
        ...

    def diagnostics(self) -> Mapping[str, FloatArray | float | bool]:
        """Return grids (ny, nx) and scalars that the controller looked at last, for recordings."""
        ...


class ControllerExtras(Protocol):
    """What a controller may have besides."""

    @property
    def config(self) -> Any:
        """Settings, for run.json: a dataclass, or plain values."""
        ...

    def remember_failure(self, position: FloatArray) -> None:
        """Grasp elsewhere than at world (3,) [m], where it failed; told after each `reset`, oldest first."""
        ...


def remembers_failures(controller: Controller) -> bool:
    """True if a controller wants to know where grasps have failed on a table that is being cleared."""
    return hasattr(controller, "remember_failure")


def remember_failures(controller: Controller, positions: Iterable[FloatArray]) -> None:
    """Tell a controller that `remembers_failures` where (3,) [m] they were, oldest first; no other one."""
    remember = getattr(controller, "remember_failure", None)
    if remember is not None:
        for position in positions:
            remember(position)
