"""Settings of the detectors and controllers of a run: each goes to every one that has it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from mpgrasp.brought import brought_object
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.settings import from_table
from mpgrasp.plugin_names import base_name
from mpgrasp.plugins import plug_in_class
from mpgrasp.settings.effects import leaves, reason_idle

if TYPE_CHECKING:
    from mpgrasp.controllers.config import ReachConfig
    from mpgrasp.detectors import DetectorConfig
    from mpgrasp.suite import Suite


@dataclass(frozen=True, kw_only=True)
class MethodSettings:
    """Settings of all that play a suite, by name; who is left out has its own."""

    detectors: Mapping[str, DetectorConfig | Mapping[str, Any]] = field(default_factory=dict)
    """Config of each detector, or the keyword arguments of a plug-in."""
    controllers: Mapping[str, ReachConfig | Mapping[str, Any]] = field(default_factory=dict)
    """The same of each controller."""

    @classmethod
    def of(
        cls, suite: Suite, detectors: Sequence[str], controllers: Sequence[str], preset: str | None = None
    ) -> MethodSettings:
        """Return the settings that a suite has for these detectors and controllers.

        Raises:
            ConfigError: as `detector_settings` and `controller_settings`.
        """
        return cls(
            detectors=detector_settings(detectors, suite.detector),
            controllers=controller_settings(controllers, suite.controller, preset),
        )


def controller_settings(
    names: Sequence[str], table: Mapping[str, Any], preset: str | None = None
) -> dict[str, ReachConfig | Mapping[str, Any]]:
    """Return the config of every controller by name; of a plug-in, its keyword arguments.

    Args:
        names: of the controllers that play.
        table: settings in which they depart from their defaults.
        preset: name of the defaults of "mvp" and "mppc", in place of their own.

    Raises:
        ConfigError: a setting that none of them has, a value that cannot be used, or a preset that is
            unknown or for none of them.
    """
    from mpgrasp.controllers import controller_defaults, settings_read
    from mpgrasp.controllers.config import PRESETS

    if preset is not None and preset not in PRESETS:
        raise ConfigError("--preset: unknown preset", got=preset, allowed=PRESETS)
    changed = {} if preset is None else PRESETS[preset]
    if preset is not None and not set(changed) & set(names):
        raise ConfigError(f"--preset {preset} has no effect", got=", ".join(names), allowed=changed)
    bases = {
        name: changed.get(name) or controller_defaults(name)
        for name in names
        if ":" not in name and brought_object("controller", name) is None
    }
    keys = {name: settings_read(name) for name in bases}
    return _share("controller", names, table, bases, keys)


def detector_settings(
    names: Sequence[str], table: Mapping[str, Any]
) -> dict[str, DetectorConfig | Mapping[str, Any]]:
    """Return the config of every detector by name; of a plug-in, its keyword arguments.

    Raises:
        ConfigError: a setting that none of them has, or a value that cannot be used.
    """
    from mpgrasp.detectors import detector_defaults

    bases = {
        name: detector_defaults(base_name(name))
        for name in names
        if ":" not in name and brought_object("detector", name) is None
    }
    keys = {name: tuple(field.name for field in fields(base)) for name, base in bases.items()}
    return _share("detector", names, table, bases, keys)


def _share(
    group: str,
    names: Sequence[str],
    table: Mapping[str, Any],
    bases: Mapping[str, Any],
    keys: Mapping[str, Sequence[str]],
) -> dict[str, Any]:
    """Return the settings of every name.

    Args:
        group: "controller" or "detector".
        names: of all that play.
        table: settings in which they depart from their defaults.
        bases: default configs of those that are no plug-ins.
        keys: names of the settings that these have.
    """
    known = {name: _named(keys[name]) if name in bases else _keywords(group, name) for name in names}
    for key in table:
        if not any(has(key) for has in known.values()):
            allowed = dict.fromkeys(item for name in bases for item in keys[name])
            raise ConfigError(
                f"setting {group}.{key}: no setting of {', '.join(names)}",
                got=table[key],
                allowed=list(allowed) or f"keywords that {', '.join(names)} can be called with",
            )
    result: dict[str, Any] = {}
    for name in names:
        own = {key: value for key, value in table.items() if known[name](key)}
        base = bases.get(name)
        where = f"setting {group} of {name}"
        result[name] = own if base is None else from_table(type(base), own, where, base)
    for path, value in leaves(table):
        takers = [name for name in names if known[name](path.partition(".")[0])]
        why = reason_idle(group, path, [result[name] for name in takers if name in bases])
        if why is not None and all(name in bases for name in takers):
            raise ConfigError(f"setting {group}.{path} has no effect: {why}", got=value)
    return result


def _named(keys: Sequence[str]) -> Callable[[str], bool]:
    return lambda key: key in keys


def _keywords(group: str, path: str) -> Callable[[str], bool]:
    """Return what is true for a keyword that a plug-in can be called with as a setting; objects have none."""
    if brought_object(group, path) is not None:
        return lambda key: False
    plug_in = plug_in_class(group, path)
    try:
        parameters = inspect.signature(plug_in).parameters
    except (TypeError, ValueError):  # what is written in C may hide its parameters
        return lambda key: False
    kinds = {name: parameter.kind for name, parameter in parameters.items()}
    any_name = inspect.Parameter.VAR_KEYWORD in kinds.values()
    by_name = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    # weights have an option of their own, which checks the file
    return lambda key: key != "weights" and (any_name or kinds.get(key) in by_name)
