"""Small plans with stand-ins, played at once."""

from __future__ import annotations

from typing import Any

import fakes

from mpgrasp.bench.playing.crew import play_all
from mpgrasp.bench.playing.plan import Plan, every_cell
from mpgrasp.files.json_values import one_line
from mpgrasp.suite import load_suite

DETECTOR = "fakes:FakeDetector"


CONTROLLER = "fakes:FakeController"


def make_plan(**settings: Any) -> Plan:
    names = {"detectors": (DETECTOR,), "controllers": (CONTROLLER,)}
    names |= {key: settings.pop(key) for key in names if key in settings}
    return Plan(suites=(load_suite("thin"),), cells=every_cell(**names), **{"episodes": 4, **settings})


def lines_of(plan: Plan, run_episode: Any = fakes.run_episode, workers: int = 0) -> list[dict]:
    lines: list[dict] = []
    play_all(plan, lines.append, workers=workers, run_episode=run_episode)
    return lines


def without_timing(lines: list[dict]) -> list[str]:
    return [one_line({key: item for key, item in line.items() if key != "timing"}) for line in lines]
