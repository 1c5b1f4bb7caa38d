"""Ladders in a run: the rungs as suites, and the next episodes from the results of those before."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from mpgrasp.bench.analysis.ladder import LadderCard
from mpgrasp.bench.ladders.declaration import load_ladder
from mpgrasp.bench.ladders.schedule import Schedule
from mpgrasp.bench.record import ErrorLine, Line, Method, Task
from mpgrasp.exceptions import ConfigError
from mpgrasp.settings.sharing import MethodSettings
from mpgrasp.suite import Suite


@dataclass(frozen=True, kw_only=True)
class LadderLayout:
    """A ladder as a plan has it."""

    suites: tuple[Suite, ...]
    """One for each rung."""
    settings: Mapping[str, MethodSettings]
    """Settings of what plays, by suite."""
    card: LadderCard


def lay_out_ladder(arguments: argparse.Namespace, methods: Sequence[Method]) -> LadderLayout:
    """Return the rungs of a command line's ladder as suites.

    Raises:
        ConfigError: an unknown ladder, options that do not go with one, or a setting that cannot be used.
    """
    ladder = load_ladder(arguments.suite)
    for option, value in (("until-ci", arguments.until_ci), ("shard", arguments.shard)):
        if value is not None:
            raise ConfigError(
                f"a ladder with --{option}: it decides by its results what comes next",
                got=str(value),
                allowed="a ladder without it",
            )
    if arguments.objects:
        raise ConfigError("a ladder with --objects", got=arguments.objects[0], allowed="a suite with them")
    detectors, controllers = (tuple(dict.fromkeys(names)) for names in zip(*methods, strict=True))
    noise, more = not arguments.no_noise, tuple(arguments.set)
    suites = tuple(ladder.at(rung, more, noise=noise) for rung in ladder.scale.levels)
    settings = {
        suite.name: MethodSettings.of(suite, detectors, controllers, arguments.preset) for suite in suites
    }
    schedule = Schedule(scale=ladder.scale)
    card = LadderCard(
        name=ladder.name,
        title=ladder.title,
        scalar=ladder.scalar,
        unit=ladder.unit,
        rungs=ladder.scale.levels,
        harder=ladder.scale.harder,
        logarithmic=ladder.scale.logarithmic,
        points=tuple(suite.name for suite in suites),
        episodes=schedule.episodes if arguments.episodes is None else arguments.episodes,
        first=schedule.first,
        starts=schedule.starts,
        batch=schedule.batch,
    )
    return LadderLayout(suites=suites, settings=settings, card=card)


class Ascent:
    """The episodes of a ladder, step by step; the results of one step decide on the next.

    Args:
        card: the ladder.
        methods: that play, each by its own results.
    """

    def __init__(self, card: LadderCard, methods: Sequence[Method]) -> None:
        self._card, self._methods = card, methods
        self._results: dict[Method, dict[float, dict[int, bool]]] = {method: {} for method in methods}

    def see(self, line: Line) -> None:
        """Take a result into account."""
        if not isinstance(line, ErrorLine):
            task = line.task
            of_rung = self._results[task.cell.method].setdefault(self._card.rung(task.suite), {})
            of_rung[task.episode] = line.success

    def steps(self) -> Iterator[list[Task]]:
        """Yield the episodes of each step, in order; they must be seen before the next step is asked for."""
        card = self._card
        schedule = Schedule(
            scale=card.scale,
            episodes=card.episodes,
            first=card.first,
            starts=card.starts,
            batch=card.batch,
        )
        counts = {method: schedule.counts(self._results[method]) for method in self._methods}
        before: dict[Method, dict[float, int]] = {method: {} for method in self._methods}
        while True:
            places: list[tuple[int, int, int]] = []
            for number, method in enumerate(self._methods):
                now = next(counts[method], None)
                if now is None:
                    continue
                for rung, most in now.items():
                    place = card.rungs.index(rung)
                    places += [(place, e, number) for e in range(before[method].get(rung, 0), most)]
                before[method] = now
            if not places:
                return
            yield [
                Task(card.points[place], episode, *self._methods[number])
                for place, episode, number in sorted(places)
            ]
