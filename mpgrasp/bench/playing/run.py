"""Plays a run from its plan to its table: batches, resumption, interruption."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from mpgrasp.anytime import confidence_sequence
from mpgrasp.bench.analysis.race import RaceCard, state_of
from mpgrasp.bench.analysis.summary import summarise
from mpgrasp.bench.playing.conclusion import EXIT_BROKEN, conclude
from mpgrasp.bench.playing.crew import Crew, check_engine, make_crew, shared_networks
from mpgrasp.bench.playing.description import describe
from mpgrasp.bench.playing.ladder import Ascent
from mpgrasp.bench.playing.patience import Patience
from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.planning import make_plan
from mpgrasp.bench.playing.player import EpisodeError, Player
from mpgrasp.bench.record import Line, Task
from mpgrasp.bench.report.terminal import RunProgress
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.command_line import EXIT_BAD_INPUT, EXIT_INTERRUPTED
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.processes import interrupts_wait
from mpgrasp.suite import Suite, episode_seed


def run(arguments: argparse.Namespace, command: Sequence[str]) -> int:
    """Play what the command line asks for.

    Returns:
        The exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    if arguments.workers < 0:
        raise ConfigError("workers out of range", got=arguments.workers, allowed="0 or more")
    check_engine(arguments.engine, arguments.workers, arguments.address)
    plan, out = make_plan(arguments)
    with shared_networks(plan.runtime, arguments.engine):
        return _run(plan, out, arguments, command)


def _run(plan: Plan, out: Path, arguments: argparse.Namespace, command: Sequence[str]) -> int:
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
            planned = plan.count() if plan.until_ci is None else None
            directory = RunDirectory.create(out, content, planned)
        # where there are workers, each has detectors of its own: these here would only take up memory
        here = None if arguments.workers else player
        del player
        code, finished = 0, False
        try:
            crew = make_crew(
                plan,
                arguments.workers,
                player=here,
                hang_after=arguments.hang_after,
                engine=arguments.engine,
                address=arguments.address,
            )
            try:
                finished = _play_batches(plan, directory, crew, progress)
            finally:
                crew.close()
                code = EXIT_BAD_INPUT if crew.losses else 0
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
        lines = directory.episodes().in_order(plan.roster().place)
        report = not arguments.no_report
        return conclude(directory, lines, content.configuration, finished=finished, report=report) or code


def _play_batches(plan: Plan, directory: RunDirectory, crew: Crew, progress: RunProgress) -> bool:
    """Play what is missing; True once nothing is.

    Batches are fixed, and whether another follows depends on the lines of the batches before alone: not
    on the number of workers, nor on where a run was interrupted.
    """
    before = directory.episodes()
    _refuse_others(plan, directory, before)
    progress.start(before)
    done = before.played_tasks()
    patience = Patience()
    ascent = None if plan.ladder is None else Ascent(plan.ladder, plan.methods)

    def sink(line: Line) -> None:
        with interrupts_wait():
            directory.append(line)
            progress.add(line)
        patience.see(line)
        if ascent is not None:
            ascent.see(line)

    def play(tasks: Iterable[Task]) -> None:
        crew.play((task for task in tasks if task not in done), sink, progress.note)

    if ascent is not None:
        progress.expect(plan.count())
        for line in before:
            ascent.see(line)
        for step in ascent.steps():
            play(step)
        return True
    if plan.race is not None:
        progress.expect(plan.count())
        _race(plan, plan.race, directory, play)
        return True
    if plan.until_ci is None:
        progress.expect(plan.count())
        play(plan.tasks())
        return True
    expected = 0
    for suite in plan.suites:
        stop, narrow = 0, False
        while not narrow and stop < plan.max_episodes:
            start, stop = stop, min(stop + plan.batch(suite), plan.max_episodes)
            progress.expect(expected + stop * len(plan.methods))
            play(plan.tasks_of(suite, start, stop))
            widths = _intervals(plan, suite, directory.episodes(), stop)
            narrow = all(100 * (high - low) < plan.until_ci for low, high in widths.values())
        for method, (low, high) in widths.items():
            progress.note(
                f"{suite.name}, {method}: {100 * low:.1f} to {100 * high:.1f} % by an interval that holds at "
                "all times at once, so that one may stop by it"
            )
        if not narrow:
            progress.note(
                f"{plan.max_episodes} episodes of each combination have not brought every interval of "
                f"{suite.name} below {plan.until_ci:g} points; --max-episodes allows more"
            )
        expected += stop * len(plan.methods)
    return True


def _race(
    plan: Plan, race: RaceCard, directory: RunDirectory, play: Callable[[Iterable[Task]], None]
) -> None:
    """Play worlds until one method is known to be better."""
    (suite,) = plan.suites
    for start in range(0, race.max_episodes, race.step):
        stop = min(start + race.step, race.max_episodes)
        play(plan.tasks_of(suite, start, stop))
        if state_of(race, suite.name, by_cell(directory.episodes()), stop).decided:
            return


def _refuse_others(plan: Plan, directory: RunDirectory, lines: Iterable[Line]) -> None:
    """Raise OutputError where a line is of no episode of the plan."""
    suites = {suite.name: suite for suite in plan.suites}
    for line in lines:
        suite, method = suites.get(line.suite), line.task.cell.method
        if suite is not None and method in plan.methods and line.seed == plan.seed:
            there = plan.has(suite, line.episode)
            if there and line.scene_seed == episode_seed(line.suite, line.seed, line.episode):
                continue
        raise OutputError(
            f"a line of {directory.episodes_file.name} is of no episode of this run",
            got=f"{line.task}, seed {line.seed}, scene_seed {line.scene_seed}",
            allowed="lines of this run alone; was the file edited?",
        )


def _intervals(plan: Plan, suite: Suite, lines: Iterable[Line], stop: int) -> dict[str, tuple[float, float]]:
    """Confidence sequence of each method of a suite by its first `stop` episodes; (0, 1) without one."""
    cells = summarise(line for line in lines if line.suite == suite.name and line.episode < stop)
    found = {str(cell.cell.method): confidence_sequence(cell.successes, cell.n) for cell in cells}
    return {str(method): found.get(str(method), (0.0, 1.0)) for method in plan.methods}
