"""The tree of settings of a run: the values that hold, by group."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from mpgrasp.controllers import CONTROLLERS, settings_read
from mpgrasp.suite import EPISODE_GROUPS

if TYPE_CHECKING:
    from mpgrasp.episode.config import EpisodeConfig

WORLD_GROUPS = tuple(group for group in EPISODE_GROUPS if group != "execution")
"""Groups of an episode's settings that say what the world is, and not what is done in it."""


def tree(
    config: EpisodeConfig, controllers: Mapping[str, Any], detectors: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the settings of a run by group, apart from those of its scenes.

    Groups are configs or tables of values. `sensor` is None where the camera is perfect, and `controller` and
    `detector` have a table for each of those that play.

    Args:
        config: of the episodes.
        controllers: config of each controller by name, or the keyword arguments of a plug-in.
        detectors: the same of each detector.
    """
    groups = {group: getattr(config, group) for group in EPISODE_GROUPS}
    own = (f.name for f in fields(config) if f.name not in (*EPISODE_GROUPS, "camera_backend"))
    return {
        "episode": {name: getattr(config, name) for name in own},
        **groups,
        "sensor": config.sensor if config.noise else None,
        "controller": {name: _read(name, settings) for name, settings in controllers.items()},
        "detector": dict(detectors),
    }


def _read(name: str, settings: Any) -> Mapping[str, Any]:
    """Return the settings of a controller that have an effect on it."""
    if name not in CONTROLLERS:
        return dict(settings)
    return {key: getattr(settings, key) for key in settings_read(name)}
