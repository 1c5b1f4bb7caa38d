"""Reaching controllers by name. They need numpy and OpenCV only, so that they run on a robot's computer."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from mpgrasp.controllers.config import ReachConfig
    from mpgrasp.controllers.controller import Controller

CONTROLLERS: dict[str, str] = {
    "mppc": "mpgrasp.controllers.mppc:Mppc",
    "mvp": "mpgrasp.controllers.mvp:Mvp",
    "mppc_robust": "mpgrasp.controllers.mppc:MppcRobust",
    "mvp_robust": "mpgrasp.controllers.mvp:MvpRobust",
    "open_loop": "mpgrasp.controllers.open_loop:OpenLoop",
    "straight_down": "mpgrasp.controllers.straight_down:StraightDown",
}
"""Import path of each controller; it is loaded when it is made."""


def make_controller(name: str, config: ReachConfig | None = None) -> Controller:
    """Return a controller by its name, with its own settings unless others are given.

    Raises:
        ConfigError: there is no controller of that name.
    """
    if name not in CONTROLLERS:
        raise ConfigError("unknown controller", got=name, allowed=CONTROLLERS)
    made: Controller = _class(name)(config)
    return made


def controller_defaults(name: str) -> ReachConfig:
    """Return the settings that a controller of the registry has unless others are given."""
    defaults: ReachConfig = _class(name).defaults
    return defaults


def settings_read(name: str) -> tuple[str, ...]:
    """Return the names of the settings that a controller of the registry reads."""
    return tuple(getattr(_class(name), "reads", vars(controller_defaults(name))))


def _class(name: str) -> Any:
    module, _, attribute = CONTROLLERS[name].partition(":")
    return getattr(import_module(module), attribute)
