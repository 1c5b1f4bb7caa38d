"""Settings that do nothing beside certain others, so that to set them would be a mistake."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple


class Idle(NamedTuple):
    """Keys of a group that have no effect as long as something else holds."""

    keys: tuple[str, ...]
    holds: Callable[[Any], bool]
    """True for a config beside which the keys do nothing."""
    because: str


_GROUPS: Mapping[str, tuple[Idle, ...]] = {
    "scene": (
        Idle(("jitter", "pattern"), lambda c: c.placing != "stack", "placing is not stack"),
        Idle(("cloth_wavelength",), lambda c: c.cloth_unevenness == 0, "cloth_unevenness is 0"),
        Idle(
            ("cloth_wrinkle_width", "cloth_wrinkle_count"),
            lambda c: c.cloth_wrinkles == 0,
            "cloth_wrinkles is 0",
        ),
        Idle(("no_return_size",), lambda c: c.no_return == 0, "no_return is 0"),
    ),
    "sensor": (
        Idle(("pattern_px", "pattern_time"), lambda c: c.fixed_pattern == 0, "fixed_pattern is 0"),
        Idle(("correlation_px",), lambda c: c.subpixel == 0, "subpixel is 0"),
    ),
    "episode": (Idle(("start_jitter",), lambda c: c.start_radius is not None, "there is a start_radius"),),
    "controller": (
        Idle(("peak_threshold",), lambda c: c.alpha == 1, "alpha is 1"),
        Idle(("z_max",), lambda c: c.cost_heights is not None, "there are cost_heights"),
        Idle(("v_z",), lambda c: c.descent == "coupled", "descent is coupled"),
    ),
    "execution": (
        Idle(("shake_amplitude", "shake_frequency"), lambda c: c.shake_time == 0, "shake_time is 0"),
        Idle(("shake_frequency",), lambda c: c.shake_amplitude == 0, "shake_amplitude is 0"),
    ),
    "ik": (
        Idle(
            ("collision_distance", "collision_range", "collision_rate"),
            lambda c: not c.collisions,
            "collisions is false",
        ),
    ),
}


def reason_idle(group: str, key: str, configs: Sequence[Any]) -> str | None:
    """Return why a setting has no effect in any of these configs of its group; None where it has one."""
    for idle in _GROUPS.get(group, ()):
        if key in idle.keys and all(map(idle.holds, configs)):
            return idle.because
    return None
