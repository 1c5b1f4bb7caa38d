"""Cost of a cell's episodes, from playing some of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mpgrasp.bench.playing.player import Player
from mpgrasp.bench.profiling.stages import PARTS, REACH, RENDER, REST, STAGES, watched
from mpgrasp.bench.profiling.stopwatch import Entry, Stopwatch
from mpgrasp.bench.record import Cell, Task


@dataclass(frozen=True, kw_only=True)
class Cost:
    """CPU time of the episodes of a cell, the mean of some."""

    cell: Cell
    episodes: int
    """Number of episodes that were played."""
    ticks: float
    """Control ticks of an episode."""
    milliseconds: dict[str, dict[str, float]]
    """CPU time of an episode by stage and, within that, by part [ms]."""

    def of(self, *, part: str | None = None, stage: str | None = None) -> float:
        """Return the time of a part, of a stage, of a stage in a part, or of everything [ms]."""
        return sum(
            time
            for name, parts in self.milliseconds.items()
            for of, time in parts.items()
            if part in (None, of) and stage in (None, name)
        )


def measure(player: Player) -> Iterator[Cost]:
    """Yield the cost of each cell of a player's plan, from all of the plan's episodes.

    One more episode of each cell is played before and not counted: it pays for what is done once.

    Raises:
        EpisodeError: an episode that cannot be played to its end.
    """
    plan = player.plan
    for suite in plan.suites:
        for method in plan.methods:
            cell = Cell(suite.name, *method)
            player.play(Task(suite.name, 0, *method))
            yield _cost(player, cell, plan.batch(suite))


def _cost(player: Player, cell: Cell, number: int) -> Cost:
    watch = Stopwatch()
    with watched(watch):
        for episode in range(number):
            with watch.stage(REST):
                player.play(Task(cell.suite, episode, *cell.method))
    return Cost(
        cell=cell,
        episodes=number,
        ticks=watch.calls[Entry(REACH, RENDER)] / number,
        milliseconds={
            stage: {part: 1e3 * watch.seconds.get(Entry(part, stage), 0.0) / number for part in PARTS}
            for stage in (*STAGES, REST)
        },
    )
