"""Settings that do nothing beside certain others, so that to set them would be a mistake."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple


class Idle(NamedTuple):
    """Keys of a group that have no effect as long as something else holds."""

    keys: tuple[str, ...]
    """With dots where a key is within another: "grid.weighted"."""
    holds: Callable[[Any], bool]
    """True for a config beside which the keys do nothing."""
    because: str


_GROUPS: Mapping[str, tuple[Idle, ...]] = {
    "scene": (
        Idle(("jitter", "pattern"), lambda c: c.placing != "stack", "placing is not stack"),
        Idle(("half_extent",), lambda c: c.placing == "stack", "placing is stack"),
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
        Idle(("z_max", "cost_heights"), lambda c: c.gamma == 0, "gamma is 0"),
        Idle(("v_z",), lambda c: c.descent == "coupled", "descent is coupled"),
        Idle(("home_yaw", "yaw_range", "yaw_rate_max"), lambda c: c.yaw_gain == 0, "yaw_gain is 0"),
        Idle(("home_yaw", "yaw_range", "yaw_gain"), lambda c: c.yaw_rate_max == 0, "yaw_rate_max is 0"),
        # the grid gives the yaw alone where the grasp is a pixel's
        Idle(("grid.weighted",), lambda c: c.choice == "pool", "choice is pool"),
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
        Idle(("posture_rate", "posture_smoothing"), lambda c: c.posture_cost == 0, "posture_cost is 0"),
        Idle(("posture_smoothing",), lambda c: c.posture_rate == 0, "posture_rate is 0"),
    ),
}


def reason_idle(group: str, key: str, configs: Sequence[Any]) -> str | None:
    """Return why a setting has no effect in any of these configs of its group; None where it has one.

    Args:
        group: of the setting.
        key: its keys, with dots between them.
        configs: all that the setting goes to; without any, nobody can say.
    """
    idles = [idle for idle in _GROUPS.get(group, ()) if key in idle.keys]
    found = [next((idle.because for idle in idles if idle.holds(config)), None) for config in configs]
    return None if None in found or not found else " and ".join(dict.fromkeys(map(str, found)))


def leaves(table: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Return the keys of a table with their values; those of tables within it with dots between them."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from ((f"{key}.{inner}", found) for inner, found in leaves(value))
        else:
            yield key, value
