"""Plays a run from its plan to its table: batches, resumption, interruption."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from mpgrasp.bench.analysis.paper import Baseline
from mpgrasp.bench.analysis.summary import RunSummary, paired_tests, summarise
from mpgrasp.bench.playing.crew import Crew, make_crew
from mpgrasp.bench.playing.description import describe
from mpgrasp.bench.playing.plan import Plan, every_method
from mpgrasp.bench.playing.player import EpisodeError, Player
from mpgrasp.bench.playing.programme import PROGRAMMES, load_suites
from mpgrasp.bench.processes import interrupts_wait
from mpgrasp.bench.record import Line, Task, played
from mpgrasp.bench.report.terminal import RunProgress, print_table, print_tests
from mpgrasp.bench.results.trace import prune_traces
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.command_line import EXIT_BAD_INPUT, EXIT_INTERRUPTED, print_error
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.plugins import check_name, controller_names, detector_names, parse_weights
from mpgrasp.settings.changes import shared_table, with_assignments
from mpgrasp.settings.sharing import controller_settings, detector_settings
from mpgrasp.suite import Suite

if TYPE_CHECKING:
    from mpgrasp.bench.meshes.check import MeshVerdict

EXIT_BROKEN = 1
DETECTOR, CONTROLLER = "dhrnet", "mppc"
"""The method that plays a suite unless told otherwise."""


def make_plan(arguments: argparse.Namespace) -> tuple[Plan, Path]:
    """The plan of a command line and the folder of its results.

    Raises:
        ConfigError: input that cannot be used.
    """
    detectors, controllers = (
        None if names is None else tuple(names.split(","))
        for names in (arguments.detector, arguments.controller)
    )
    for name in detectors or ():
        check_name("detector", name, detector_names())
    for name in controllers or ():
        check_name("controller", name, controller_names())
    only = None if arguments.suites is None else tuple(arguments.suites.split(","))
    suites, programme = load_suites(arguments.suite, only), PROGRAMMES.get(arguments.suite)
    if arguments.baseline is not None and (programme is None or controllers is not None):
        raise ConfigError(
            "--baseline says which controllers of a programme play",
            got=arguments.baseline,
            allowed=f"with {', '.join(PROGRAMMES)}, and without --controller",
        )
    if programme is None:
        methods = every_method(detectors or (DETECTOR,), controllers or (CONTROLLER,))
    else:
        baseline = None if arguments.baseline is None else Baseline(arguments.baseline)
        methods = programme.methods(detectors, controllers, baseline)
    suites, objects = _with_objects(suites, arguments)
    suites = with_assignments(suites, arguments.set, noise=not arguments.no_noise)
    detectors, controllers = (tuple(dict.fromkeys(names)) for names in zip(*methods, strict=True))
    name = suites[0].name if programme is None else arguments.suite
    out = arguments.out or Path("runs") / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    plan = Plan(
        suites=suites,
        objects=objects,
        programme=None if programme is None else name,
        methods=methods,
        weights=parse_weights(arguments.weights, detectors),
        detector_settings=detector_settings(detectors, shared_table(suites, "detector")),
        controller_settings=controller_settings(
            controllers, shared_table(suites, "controller"), arguments.preset
        ),
        runtime=arguments.runtime,
        episodes=arguments.episodes,
        until_ci=arguments.until_ci,
        max_episodes=arguments.max_episodes,
        seed=arguments.seed,
        camera=arguments.camera,
        noise=not arguments.no_noise,
        record=arguments.record,
        recordings=out / "recordings",
        traces=out / "traces",
    )
    return plan, out


def _with_objects(
    suites: tuple[Suite, ...], arguments: argparse.Namespace
) -> tuple[tuple[Suite, ...], tuple[MeshVerdict, ...]]:
    """The suites with the objects that the command line brings, if any, and the verdict on every mesh."""
    if not arguments.objects:
        return suites, ()
    if len(suites) > 1:
        raise ConfigError("--objects with several suites", got=arguments.suite, allowed="one suite")
    from mpgrasp.bench.meshes.intake import take_objects

    suite, verdicts = take_objects(
        suites[0],
        arguments.objects,
        density=arguments.density,
        workers=arguments.workers,
        quiet=arguments.quiet,
    )
    return (suite,), verdicts


def run(arguments: argparse.Namespace, command: Sequence[str]) -> int:
    """Play what the command line asks for.

    Returns:
        The exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    if arguments.workers < 0:
        raise ConfigError("workers out of range", got=arguments.workers, allowed="0 or more")
    plan, out = make_plan(arguments)
    player = Player(plan)  # whatever is wrong with a detector or controller shows before the first episode
    ready = player.prepare()
    if plan.objects:
        from mpgrasp.bench.meshes.intake import print_verdicts

        print_verdicts(plan.objects)
    content = describe(plan, player, command)
    with RunProgress(quiet=arguments.quiet) as progress:
        for line in ready:
            progress.note(line)
        if arguments.resume:
            directory = RunDirectory.resume(out, content, progress.note)
        else:
            planned = len(plan.tasks()) if plan.until_ci is None else None
            directory = RunDirectory.create(out, content, planned)
        # where there are workers, each has detectors of its own: these here would only take up memory
        here = None if arguments.workers else player
        del player
        code, finished = 0, False
        try:
            crew = make_crew(plan, arguments.workers, player=here, hang_after=arguments.hang_after)
            try:
                finished = _play_batches(plan, directory, crew, progress)
            finally:
                crew.close()
        except KeyboardInterrupt:
            progress.note("interrupted; the finished episodes are kept")
            code = EXIT_INTERRUPTED
        except EpisodeError as error:
            progress.note(f"error: {error}")
            code = EXIT_BROKEN
        except OutputError as error:
            progress.note(f"error: {error}; the finished episodes are kept")
            code = EXIT_BAD_INPUT
    with interrupts_wait():
        return _conclude(plan, directory, finished) or code


def _play_batches(plan: Plan, directory: RunDirectory, crew: Crew, progress: RunProgress) -> bool:
    """Play what is missing; True once nothing is.

    Batches are fixed, and whether another follows depends on the lines of the batches before alone: not
    on the number of workers, nor on where a run was interrupted.
    """
    before = directory.episodes()
    progress.start(before)
    done = {line.task for line in played(before)}

    def sink(line: Line) -> None:
        with interrupts_wait():
            directory.append(line)
            progress.add(line)

    def play(tasks: list[Task]) -> None:
        crew.play([task for task in tasks if task not in done], sink, progress.note)

    if plan.until_ci is None:
        progress.expect(len(plan.tasks()))
        play(plan.tasks())
        return True
    expected = 0
    for suite in plan.suites:
        stop, narrow = 0, False
        while not narrow and stop < plan.max_episodes:
            start, stop = stop, min(stop + plan.batch(suite), plan.max_episodes)
            progress.expect(expected + stop * len(plan.methods))
            play(plan.tasks_of(suite, start, stop))
            narrow = _narrow(plan, suite, directory.episodes(), stop)
        if not narrow:
            progress.note(
                f"{plan.max_episodes} episodes of each combination have not brought every interval of "
                f"{suite.name} below {plan.until_ci:g} points; --max-episodes allows more"
            )
        expected += stop * len(plan.methods)
    return True


def _narrow(plan: Plan, suite: Suite, lines: Sequence[Line], stop: int) -> bool:
    """True if the first `stop` episodes of a suite leave no cell's interval as wide as `until_ci`."""
    assert plan.until_ci is not None
    cells = summarise(line for line in lines if line.suite == suite.name and line.episode < stop)
    widths = [100 * (cell.wilson_high - cell.wilson_low) for cell in cells]
    return len(widths) == len(plan.methods) and max(widths) < plan.until_ci


def _conclude(plan: Plan, directory: RunDirectory, finished: bool) -> int:
    """Put the lines in order, write and print what they add up to; the exit code that follows from it."""
    from mpgrasp.bench.report.build import write_report

    code = 0
    lines = sorted(directory.episodes(), key=lambda line: plan.place(line.task))
    cells, tests = summarise(lines), paired_tests(lines)
    errors = sum(cell.errors for cell in cells)
    try:
        directory.settle(lines)
        directory.write_summary(
            RunSummary(complete=finished and not errors, cells=tuple(cells), paired_tests=tuple(tests))
        )
        prune_traces(directory.path / "traces")
        write_report([directory.path], directory.path)
    except OutputError as error:
        print_error(error)
        code = EXIT_BAD_INPUT
    finally:
        directory.close()
    print_table(cells)
    print_tests(tests)
    print(f"Results: {directory.path}")
    if errors:
        print(
            f"mpgrasp: {errors} episodes could not be played, see {directory.path / 'errors'}; "
            f"--resume {directory.path} tries them again",
            file=sys.stderr,
        )
        code = code or EXIT_BROKEN
    return code
