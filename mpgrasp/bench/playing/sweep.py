"""Sweeps: a suite with a grid of settings, laid out as one suite for each point of the grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mpgrasp.bench.analysis.sweep import Sweep, SweepPoint, SweptSetting
from mpgrasp.bench.playing.description import suite_card
from mpgrasp.bench.record import Method
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.json_values import json_value
from mpgrasp.settings.changes import at_point, with_assignments
from mpgrasp.settings.grid import Grid
from mpgrasp.settings.sharing import MethodSettings
from mpgrasp.suite import Suite


@dataclass(frozen=True, kw_only=True)
class Layout:
    """A sweep as a plan has it."""

    suites: tuple[Suite, ...]
    """One for each point."""
    settings: Mapping[str, MethodSettings]
    """Settings of what plays, by suite."""
    sweep: Sweep


def lay_out(
    suite: Suite, grid: Grid, methods: Sequence[Method], *, noise: bool, preset: str | None
) -> Layout:
    """Return the points of a grid as suites.

    Args:
        suite: that is swept.
        grid: of its settings.
        methods: that play every point.
        noise: False where the camera is perfect.
        preset: defaults of mvp and mppc, as for a run.

    Raises:
        ConfigError: a setting that is unknown, without effect or out of range at a point; it names the point.
    """
    names = _names(methods)
    suites, settings, points = [], {}, []
    for place in grid.points():
        try:
            point = at_point(suite, place, noise=noise)
            settings[point.name] = MethodSettings.of(point, *names, preset)
        except ConfigError as error:
            raise ConfigError(f"at {place.label}: {error}") from error
        suites.append(point)
        points.append(SweepPoint(suite=point.name, texts=place.texts))
    axes = tuple(
        SweptSetting(
            setting=axis.setting, name=axis.name, texts=axis.texts, values=tuple(json_value(axis.values))
        )
        for axis in grid.axes
    )
    own = _own(suite, grid, methods, noise, preset)
    references = {}
    for method in methods:
        like = (s.name for s in suites if _settings(s, settings[s.name], method) == own.get(method))
        references[str(method)] = next(like, suites[0].name)
    sweep = Sweep(suite=suite.name, axes=axes, points=tuple(points), references=references)
    return Layout(suites=tuple(suites), settings=settings, sweep=sweep)


def _own(
    suite: Suite, grid: Grid, methods: Sequence[Method], noise: bool, preset: str | None
) -> dict[Method, Any]:
    """Return all settings of each method in the suite as it is, with what holds for all points."""
    try:
        (fixed,) = with_assignments((suite,), grid.fixed, noise=noise)
        settings = MethodSettings.of(fixed, *_names(methods), preset)
    except ConfigError:  # it takes the grid's values beside the fixed ones, so no point is the suite as it is
        return {}
    return {method: _settings(fixed, settings, method) for method in methods}


def _settings(suite: Suite, settings: MethodSettings, method: Method) -> Any:
    """Return all that decides the episodes of a method in a suite, as plain values."""
    return (
        suite_card(suite).scenes,
        json_value(suite.episode_config()),
        json_value(settings.detectors.get(method.detector)),
        json_value(settings.controllers.get(method.controller)),
    )


def _names(methods: Sequence[Method]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the detectors, and those of the controllers."""
    detectors, controllers = (tuple(dict.fromkeys(names)) for names in zip(*methods, strict=True))
    return detectors, controllers
