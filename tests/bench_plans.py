"""Small plans with stand-ins, played at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import fakes

from mpgrasp.bench.playing.crew import Note, Sink, make_crew
from mpgrasp.bench.playing.plan import Plan, every_method
from mpgrasp.bench.playing.player import Games
from mpgrasp.bench.record import Line
from mpgrasp.files.json_values import one_line
from mpgrasp.suite import load_suite

DETECTOR = "fakes:FakeDetector"


CONTROLLER = "fakes:FakeController"


def make_plan(**settings: Any) -> Plan:
    names = {"detectors": (DETECTOR,), "controllers": (CONTROLLER,)}
    names |= {key: settings.pop(key) for key in names if key in settings}
    return Plan(suites=(load_suite("thin"),), methods=every_method(**names), **{"episodes": 4, **settings})


def play(
    plan: Plan,
    sink: Sink,
    *,
    workers: int = 0,
    run_episode: Games = fakes.run_episode,
    hang_after: float | None = None,
    note: Note = lambda _: None,
) -> None:
    """Play a plan's first batch with a crew of its own."""
    crew = make_crew(plan, workers, run_episode=run_episode, hang_after=hang_after)
    try:
        crew.play(plan.tasks(), sink, note)
    finally:
        crew.close()


def lines_of(plan: Plan, run_episode: Games = fakes.run_episode, workers: int = 0) -> list[Line]:
    lines: list[Line] = []
    play(plan, lines.append, workers=workers, run_episode=run_episode)
    return lines


def without_timing(lines: Sequence[Line]) -> list[str]:
    return [one_line({k: v for k, v in line.as_row().items() if k != "timing"}) for line in lines]
