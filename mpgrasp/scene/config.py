"""Settings of a scene: the objects on the table, the way they are placed, the cloth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.objects.model import ObjectModel
from mpgrasp.workspace import WORKSPACE_CENTRE

MAX_OBJECTS = 40
"""Most objects of a scene: the paper clears ten, and contacts grow with their number."""


@dataclass(frozen=True, kw_only=True)
class SceneConfig:
    """Objects on the table, the way they are placed, and the cloth below them."""

    objects: tuple[str | ObjectModel, ...] = ("usb_stick",)
    """Names from the catalogue, or objects."""
    count: int | None = None
    """Number of them, drawn by the seed without replacement; None = all of them, in order."""
    placing: Literal["scatter", "pile", "stack"] = "scatter"
    """Next to each other, dropped one after the other near the centre, or set down in a fixed pattern."""
    pattern: tuple[tuple[float, float, float], ...] = ()
    """Places in a stack: x, y from the centre [m] and heading [rad] of each object; every object comes to lie
    on those before it."""
    jitter: tuple[float, float] = (0.003, 0.05)
    """Largest deviation of a stack from its pattern in x and in y [m], and in heading [rad]."""
    pose: Literal["upright", "random"] = "upright"
    """Dropped as meant to stand or lie, or in any orientation; yaw is always random."""
    centre: tuple[float, float] = WORKSPACE_CENTRE
    """World x, y of the placing region [m]."""
    centre_spread: float = 0.0
    """Half the edge of the square about it in which the region's own centre is drawn [m]; 0 = it is fixed."""
    half_extent: float = 0.10
    """Half the edge of the placing region [m]."""
    cloth_unevenness: float = 0.0006
    """Root mean square of the cloth's height about its mean [m]; 0 = flat."""
    cloth_wavelength: float = 0.06
    """Mean distance between the cloth's crests along a straight line [m]."""
    cloth_wrinkles: float = 0.0
    """Height of the cloth's wrinkles over its waves: long, narrow ridges [m]; 0 = none."""
    cloth_wrinkle_width: float = 0.03
    """Width of a wrinkle at half of its height [m]."""
    cloth_wrinkle_count: int = 8
    """Number of wrinkles on the cloth."""
    no_return: float = 0.0
    """Part of the objects' surfaces that the depth camera gets no return from, in patches [0, 1]."""
    no_return_size: float = 0.01
    """Length over which such a patch goes on [m]."""
    camouflage: bool = False
    """Give all objects the colour of the cloth."""
    basket: bool = False
    """Set the drop basket beside the workspace."""

    def __post_init__(self) -> None:
        for name in ("objects", "centre", "jitter"):  # declarations give lists
            object.__setattr__(self, name, tuple(getattr(self, name)))
        object.__setattr__(self, "pattern", tuple(tuple(place) for place in self.pattern))
        if not self.objects:
            raise ConfigError("a scene without objects", got="objects = []", allowed="one or more")
        if (n := len(self.objects) if self.count is None else self.count) > MAX_OBJECTS:
            raise ConfigError("too many objects", got=n, allowed=f"up to {MAX_OBJECTS}")
        if self.count is not None and not 1 <= self.count <= len(self.objects):
            raise ConfigError(
                "unusable count of objects", got=self.count, allowed=f"1 to {len(self.objects)}"
            )
        _one_of("placing", self.placing, ("scatter", "pile", "stack"))
        self._check_pattern()
        _one_of("pose", self.pose, ("upright", "random"))
        if len(self.centre) != 2 or not np.isfinite(self.centre).all():
            raise ConfigError("unusable centre of the placing region", got=self.centre, allowed="x and y [m]")
        _within("spread of the placing region's centre [m]", self.centre_spread, 0.0, 0.3)
        _within("half extent of the placing region [m]", self.half_extent, 0.0, 0.4)
        _within("unevenness of the cloth [m]", self.cloth_unevenness, 0.0, 0.01)
        _within("wavelength of the cloth [m]", self.cloth_wavelength, 0.04, 1.0)
        _within("height of the cloth's wrinkles [m]", self.cloth_wrinkles, 0.0, 0.02)
        # narrower ones fall between the points of the cloth
        _within("width of the cloth's wrinkles [m]", self.cloth_wrinkle_width, 0.02, 0.2)
        _within("count of the cloth's wrinkles", self.cloth_wrinkle_count, 1, 100)
        _within("part of the surfaces without return", self.no_return, 0.0, 1.0)
        _within("length of patches without return [m]", self.no_return_size, 0.001, 0.2)

    def _check_pattern(self) -> None:
        if self.placing != "stack":
            if self.pattern:
                raise ConfigError("a pattern needs placing", got=self.placing, allowed="stack")
            return
        n = len(self.objects)
        if self.count is not None or self.pose != "upright":
            raise ConfigError(
                "a stack is upright and of all its objects",
                got=(self.count, self.pose),
                allowed="no count, pose upright",
            )
        if np.shape(self.pattern) != (n, 3) or not np.isfinite(self.pattern).all():
            raise ConfigError(
                "unusable pattern of a stack", got=self.pattern, allowed=f"x, y, heading of {n} objects"
            )
        if np.shape(self.jitter) != (2,) or not np.all(np.greater_equal(self.jitter, 0)):
            raise ConfigError(
                "unusable jitter of a stack", got=self.jitter, allowed="metres and radians, not negative"
            )


def _one_of(what: str, value: object, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ConfigError(f"unknown {what}", got=value, allowed=allowed)


def _within(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ConfigError(f"{what} out of range", got=value, allowed=f"{low} to {high}")
