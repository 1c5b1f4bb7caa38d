"""Guard of the controllers: commands, final grasps and diagnostics in their units, or an error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real

import numpy as np

from mpgrasp.controllers.controller import Command
from mpgrasp.exceptions import PlugInError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp
from mpgrasp.guards.words import TENSOR_REMEDY, described, is_tensor
from mpgrasp.robot.hand import GRIPPER_MAX_WIDTH

MAX_SPEED, MAX_RATE = 10.0, 10.0
"""Linear [m/s] and angular speed [rad/s] beyond which a twist is in other units. What lies below and is still
too fast for the robot (1.7 m/s, 2.5 rad/s) ends in a protective stop, as it would on the robot."""
MAX_REACH = 2.0
"""A grasp farther from the robot's base than this in any direction is in other units [m]; the arm reaches
0.855 m."""
MAX_OPENING = 1.0
"""Opening of a grasp beyond which it is in other units [m]; detectors may claim more than the hand has."""
ROUNDING = 1e-4
"""Beyond its range by less than this is a range met."""


def check_command(value: object, owner: str) -> Command:
    """Return what a controller commands, once it is known to be usable.

    Raises:
        PlugInError: no Command, or a twist, an opening or a `done` of another form, unit or range.
    """
    if not isinstance(value, Command):
        raise PlugInError(
            f"{owner}: update returned no Command",
            got=described(value),
            allowed="Command(twist=..., gripper=..., done=...)",
        )
    twist = _numbers(value.twist, 6, f"{owner}: the command's twist", "linear [m/s], then angular [rad/s]")
    linear, angular = math.hypot(*twist[:3]), math.hypot(*twist[3:])
    if linear > MAX_SPEED or angular > MAX_RATE:
        unit = "mm/s" if linear > MAX_SPEED else "degrees per second"
        raise PlugInError(
            f"{owner}: the command's twist is no motion of an arm",
            got=described(value.twist),
            allowed=f"up to {MAX_SPEED:g} m/s and {MAX_RATE:g} rad/s; looks like {unit}",
        )
    hint = "; looks like millimetres" if _is_number(value.gripper) and 1 <= value.gripper <= 200 else ""
    _within(
        value.gripper,
        0,
        GRIPPER_MAX_WIDTH,
        f"{owner}: the command's gripper",
        f"0 to {GRIPPER_MAX_WIDTH:g} [m]{hint}",
    )
    if not isinstance(value.done, bool | np.bool_):
        raise PlugInError(
            f"{owner}: the command's done is no truth", got=described(value.done), allowed="True or False"
        )
    return value


def check_final_grasp(value: object, owner: str) -> Grasp | None:
    """Return the grasp that a controller chose, or None for none, once it is known to be usable.

    Raises:
        PlugInError: neither a Grasp nor None, or a field of another form, unit or range.
    """
    if value is None:
        return None
    if not isinstance(value, Grasp):
        raise PlugInError(
            f"{owner}: final_grasp returned no Grasp", got=described(value), allowed="a Grasp, or None"
        )
    name = f"{owner}: the final grasp's"
    position = _numbers(value.position, 3, f"{name} position", "world x, y, z [m]")
    if max(map(abs, position)) > MAX_REACH:
        raise PlugInError(
            f"{name} position is out of reach",
            got=described(value.position),
            allowed=f"within {MAX_REACH:g} m of the base; looks like millimetres or pixels",
        )
    degrees = _is_number(value.angle) and math.pi + ROUNDING < abs(value.angle) <= 360
    hint = "looks like degrees" if degrees else "mpgrasp.geometry.wrap_half_pi folds it"
    _within(value.angle, -math.pi / 2, math.pi / 2, f"{name} angle", f"-pi/2 to pi/2 [rad]; {hint}")
    hint = "; looks like millimetres or pixels" if _is_number(value.width) and value.width > 1 else ""
    _within(value.width, 0, MAX_OPENING, f"{name} width", f"0 to {MAX_OPENING:g} [m]{hint}")
    _within(value.quality, 0, 1, f"{name} quality", "0 to 1")
    return value


def check_diagnostics(value: object, owner: str) -> Mapping[str, FloatArray | float | bool]:
    """Return what a controller shows for recordings, once it is known to be a mapping by name.

    Raises:
        PlugInError: it is none.
    """
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise PlugInError(
            f"{owner}: diagnostics returned no mapping",
            got=described(value),
            allowed="a dict of arrays and numbers by name, {} for none",
        )
    return value


def _numbers(value: object, count: int, name: str, meaning: str) -> list[float]:
    """Return an array (count,) as finite numbers."""
    form = f"a numpy array ({count},) of finite numbers: {meaning}"
    if is_tensor(value):
        raise PlugInError(f"{name} is a tensor", got=described(value), allowed=TENSOR_REMEDY)
    if not isinstance(value, np.ndarray) or value.shape != (count,) or value.dtype.kind not in "iuf":
        raise PlugInError(f"{name} has the wrong form", got=described(value), allowed=form)
    numbers: list[float] = value.tolist()
    if not all(map(math.isfinite, numbers)):
        raise PlugInError(f"{name} is not finite", got=numbers, allowed=form)
    return numbers


def _within(value: object, low: float, high: float, name: str, allowed: str) -> None:
    if not _is_number(value):
        allowed = f"{TENSOR_REMEDY}.item()" if is_tensor(value) else f"a number, {allowed}"
        raise PlugInError(f"{name} is no number", got=described(value), allowed=allowed)
    number = float(value)  # type: ignore[arg-type]
    if not math.isfinite(number):
        raise PlugInError(f"{name} is not finite", got=number, allowed=allowed)
    if not low - ROUNDING <= number <= high + ROUNDING:
        raise PlugInError(f"{name} is out of range", got=number, allowed=allowed)


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool | np.bool_)
