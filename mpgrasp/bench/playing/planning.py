"""The plan of a command line."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from mpgrasp.bench.analysis.paper import Baseline
from mpgrasp.bench.analysis.race import RaceCard, method_named
from mpgrasp.bench.playing.ladder import lay_out_ladder
from mpgrasp.bench.playing.plan import Plan, Shard, every_method
from mpgrasp.bench.playing.programme import PROGRAMMES, load_suites
from mpgrasp.bench.playing.sweep import Layout, lay_out
from mpgrasp.bench.record import Method
from mpgrasp.command_line import MOST_UNTIL_CI
from mpgrasp.exceptions import ConfigError
from mpgrasp.extras import check_installed
from mpgrasp.plugin_names import canonical, detectors_of, method_of, names_of
from mpgrasp.plugins import check_name, controller_names, detector_names, parse_weights
from mpgrasp.settings.changes import refuse_different_methods, with_assignments
from mpgrasp.settings.grid import parse_grid
from mpgrasp.settings.sharing import MethodSettings
from mpgrasp.suite import Suite

if TYPE_CHECKING:
    from mpgrasp.bench.meshes.check import MeshVerdict

RACE_STEP = 5
"""Worlds between two looks at a race."""
DETECTOR, CONTROLLER = "dhrnet", "mppc"
"""The method that plays a suite unless told otherwise."""


def make_plan(arguments: argparse.Namespace) -> tuple[Plan, Path]:
    """The plan of a command line and the folder of its results.

    Raises:
        ConfigError: input that cannot be used.
    """
    for option in ("density", "scale"):
        if getattr(arguments, option) is not None and not arguments.objects:
            raise ConfigError(f"--{option} without --objects", got=getattr(arguments, option))
    used = (
        arguments.until_ci is not None or arguments.race or arguments.resume
    )  # of an older run it may say so
    if arguments.max_episodes is not None and not used:
        raise ConfigError(
            "--max-episodes without --until-ci", got=arguments.max_episodes, allowed="--episodes"
        )
    only_detectors: Sequence[str] = ()
    own: dict[str, Path] = {}
    if arguments.detector is not None:
        only_detectors, own = detectors_of(arguments.detector)
    only_controllers: Sequence[str] = ()
    if arguments.controller is not None:
        only_controllers = names_of("controller", arguments.controller)
    for name in only_detectors:
        check_name("detector", name, detector_names())
    for name in only_controllers:
        check_name("controller", name, controller_names())
    only = None if arguments.suites is None else tuple(arguments.suites.split(","))
    if arguments.ladder:
        return _ladder_plan(
            arguments, every_method(only_detectors or (DETECTOR,), only_controllers or (CONTROLLER,)), own
        )
    suites, programme = load_suites(arguments.suite, only), PROGRAMMES.get(arguments.suite)
    race = None
    if arguments.race:
        race, own = _race(arguments, suites)
    if arguments.baseline is not None and (programme is None or only_controllers):
        raise ConfigError(
            "--baseline says which controllers of a programme play",
            got=arguments.baseline,
            allowed=f"with {', '.join(PROGRAMMES)}, and without --controller",
        )
    if race is not None:
        methods = tuple(map(method_named, (race.first, race.second)))
    elif programme is None:
        methods = every_method(only_detectors or (DETECTOR,), only_controllers or (CONTROLLER,))
    else:
        baseline = None if arguments.baseline is None else Baseline(arguments.baseline)
        methods = programme.methods(only_detectors, only_controllers, baseline)
    suites, objects = _with_objects(suites, arguments)
    name = suites[0].name if programme is None else arguments.suite
    laid = _swept(suites, methods, arguments) if arguments.sweep else None
    if laid is None:
        suites = with_assignments(suites, arguments.set, noise=not arguments.no_noise)
        refuse_different_methods(suites)
    detectors, controllers = (tuple(dict.fromkeys(names)) for names in zip(*methods, strict=True))
    out = arguments.out or Path("runs") / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    plan = Plan(
        suites=suites if laid is None else laid.suites,
        objects=objects,
        programme=None if programme is None and laid is None else name,
        sweep=None if laid is None else laid.sweep,
        methods=methods,
        weights=parse_weights(arguments.weights, detectors, own),
        settings=_settings(suites, detectors, controllers, arguments.preset)
        if laid is None
        else laid.settings,
        runtime=arguments.runtime,
        race=race,
        episodes=arguments.episodes if race is None else race.max_episodes,
        until_ci=arguments.until_ci,
        max_episodes=arguments.max_episodes or MOST_UNTIL_CI,
        seed=arguments.seed,
        camera=arguments.camera,
        noise=not arguments.no_noise,
        shard=None if arguments.shard is None else Shard.parse(arguments.shard),
        record=_recorded(arguments),
        recordings=out / "recordings",
        traces=None if arguments.no_report else out / "traces",
    )
    return plan, out


def _recorded(arguments: argparse.Namespace) -> int:
    """The number of episodes to record; ConfigError where they cannot be."""
    if arguments.record:
        check_installed("rerun", "--record")
    record: int = arguments.record
    return record


def _race(arguments: argparse.Namespace, suites: Sequence[Suite]) -> tuple[RaceCard, dict[str, Path]]:
    """The race of a command line, and the weights that its detectors bring."""
    if len(suites) > 1:
        raise ConfigError("a race in several suites", got=arguments.suite, allowed="one suite")
    typed = [method_of(name) for name in arguments.race]
    detectors, own = detectors_of(",".join(dict.fromkeys(detector for detector, _ in typed)))
    called = dict(zip(dict.fromkeys(detector for detector, _ in typed), detectors, strict=True))
    first, second = (Method(called[detector], canonical("controller", name)) for detector, name in typed)
    for method in (first, second):
        check_name("detector", method.detector, detector_names())
        check_name("controller", method.controller, controller_names())
    card = RaceCard(
        first=str(first),
        second=str(second),
        alpha=arguments.alpha,
        max_episodes=arguments.max_episodes or MOST_UNTIL_CI,
        step=RACE_STEP,
    )
    return card, own


def _ladder_plan(
    arguments: argparse.Namespace, methods: tuple[Method, ...], own: Mapping[str, Path]
) -> tuple[Plan, Path]:
    """The plan of a ladder and the folder of its results."""
    if arguments.baseline is not None or arguments.suites is not None:
        option = "baseline" if arguments.suites is None else "suites"
        raise ConfigError(f"a ladder with --{option}", got=getattr(arguments, option), allowed="with paper")
    laid = lay_out_ladder(arguments, methods)
    out = arguments.out or Path("runs") / f"{laid.card.name}-{datetime.now():%Y%m%d-%H%M%S}"
    detectors = tuple(dict.fromkeys(method.detector for method in methods))
    plan = Plan(
        suites=laid.suites,
        programme=laid.card.name,
        ladder=laid.card,
        methods=methods,
        weights=parse_weights(arguments.weights, detectors, own),
        settings=laid.settings,
        runtime=arguments.runtime,
        episodes=arguments.episodes,
        seed=arguments.seed,
        camera=arguments.camera,
        noise=not arguments.no_noise,
        record=_recorded(arguments),
        recordings=out / "recordings",
        traces=None if arguments.no_report else out / "traces",
    )
    return plan, out


def _settings(
    suites: Sequence[Suite], detectors: Sequence[str], controllers: Sequence[str], preset: str | None
) -> dict[str, MethodSettings]:
    """The settings of what plays, the same in every suite."""
    shared = MethodSettings.of(suites[0], detectors, controllers, preset)
    return {suite.name: shared for suite in suites}


def _swept(suites: Sequence[Suite], methods: Sequence[Method], arguments: argparse.Namespace) -> Layout:
    """The points of a sweep, each as a suite."""
    if len(suites) > 1:
        raise ConfigError("a sweep of several suites", got=arguments.suite, allowed="one suite")
    grid = parse_grid(arguments.set)
    return lay_out(suites[0], grid, methods, noise=not arguments.no_noise, preset=arguments.preset)


def _with_objects(
    suites: tuple[Suite, ...], arguments: argparse.Namespace
) -> tuple[tuple[Suite, ...], tuple[MeshVerdict, ...]]:
    """The suites with the objects that the command line brings, if any, and the verdict on every mesh."""
    if not arguments.objects:
        return suites, ()
    if len(suites) > 1:
        raise ConfigError("--objects with several suites", got=arguments.suite, allowed="one suite")
    from mpgrasp.bench.meshes.intake import take_objects
    from mpgrasp.scene.objects.from_mesh import DENSITY

    suite, verdicts = take_objects(
        suites[0],
        arguments.objects,
        density=DENSITY if arguments.density is None else arguments.density,
        scale=1.0 if arguments.scale is None else arguments.scale,
        workers=arguments.workers,
        quiet=arguments.quiet,
    )
    return (suite,), verdicts
