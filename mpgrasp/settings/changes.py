"""Suites as the command line changes them: `--set` on top of what they declare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

from mpgrasp.exceptions import ConfigError
from mpgrasp.settings.assignment import Tables, parse_assignments
from mpgrasp.settings.effects import leaves, reason_idle
from mpgrasp.settings.grid import GridPoint, canonical_assignment
from mpgrasp.suite import EPISODE_GROUPS, GROUPS, METHOD_GROUPS, Suite, point_name

_WHERE = "--set {}"


def with_assignments(suites: Sequence[Suite], texts: Sequence[str], *, noise: bool) -> tuple[Suite, ...]:
    """Return suites with what `--set` changes of them.

    An episode's setting goes to every suite whose episodes have it. Settings of detectors and controllers
    are kept in the suites, to be checked where it is known who plays.

    Args:
        suites: that are played.
        texts: assignments such as "sensor.subpixel=0.12".
        noise: False where the camera is perfect, so that settings of the sensor mean nothing.

    Raises:
        ConfigError: a setting that is unknown or without effect, or a value that cannot be used.
    """
    tables = parse_assignments([f"{setting}={value}" for setting, value in map(canonical_assignment, texts)])
    for group, table in tables.items():
        if group not in GROUPS:
            place = f"--set {group}.{next(iter(table))}"
            raise ConfigError(f"{place}: unknown group of settings", got=group, allowed=GROUPS)
    if "sensor" in tables and not noise:
        place = f"--set sensor.{next(iter(tables['sensor']))}"
        raise ConfigError(f"{place} has no effect", got="--no-noise", allowed="one of both")
    changed = tuple(suite.with_settings(_known(suite, suites, tables), _WHERE) for suite in suites)
    for group in (group for group in tables if group not in METHOD_GROUPS):
        for key, value in leaves(tables[group]):
            why = reason_idle(group, key, _configs(changed, group))
            if why is not None:
                raise ConfigError(f"--set {group}.{key} has no effect: {why}", got=value)
    return changed


def at_point(suite: Suite, point: GridPoint, *, noise: bool) -> Suite:
    """Return a suite as a point of a sweep has it; the name says which.

    Raises:
        ConfigError: as `with_assignments`.
    """
    (changed,) = with_assignments((suite,), point.assignments, noise=noise)
    return replace(changed, name=point_name(suite.name, point.label))


def refuse_different_methods(suites: Sequence[Suite]) -> None:
    """Raise ConfigError where suites of one run have different settings for what plays."""
    groups: tuple[Literal["detector", "controller"], ...] = ("detector", "controller")
    for group in groups:
        first, *others = (getattr(suite, group) for suite in suites)
        if any(table != first for table in others):
            raise ConfigError(
                f"suites of one run differ in [{group}]",
                got=[suite.name for suite in suites],
                allowed="the same settings of what plays, or a run for each suite",
            )


def _known(suite: Suite, suites: Sequence[Suite], tables: Tables) -> Tables:
    """Return the tables without an episode's settings that other suites have and this one does not."""
    others = {key for other in suites for key in other.episode_keys} - set(suite.episode_keys)
    episode = {key: value for key, value in tables.get("episode", {}).items() if key not in others}
    return {**tables, "episode": episode}


def _configs(suites: Sequence[Suite], group: str) -> list[Any]:
    """Return all configs of a group."""
    if group == "scene":
        return [scene for suite in suites for scene in suite.scenes]
    configs = [suite.episode_config() for suite in suites]
    return [getattr(config, group) for config in configs] if group in EPISODE_GROUPS else configs
