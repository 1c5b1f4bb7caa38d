"""A controller that is tried, and reaches that several laws look at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from mpgrasp.check.flight import Flight, Peak, fly
from mpgrasp.controllers.controller import Controller

NEAR, FAR = Peak(x=0.52, y=0.03), Peak(x=0.46, y=-0.06, angle=-0.8, width=0.05)
"""Two places of a lone grasp, both in view from the start."""


@dataclass(kw_only=True)
class ControllerSubject:
    """A controller, and how another of its kind is made."""

    make: Callable[[], Controller]
    controller: Controller

    @classmethod
    def of(cls, make: Callable[[], Controller]) -> ControllerSubject:
        """Return what is tried."""
        return cls(make=make, controller=make())

    @cached_property
    def over_peak(self) -> Flight:
        """A reach over one peak."""
        return fly(self.controller, NEAR)

    @cached_property
    def over_nothing(self) -> Flight:
        """A reach over an empty table."""
        return fly(self.controller)
