"""Laws of forecasts: a sample tells the time of all, by the schedule that a pool of workers would keep."""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Iterable
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from bench_runs import grasp_row

from mpgrasp.bench.playing.plan import Plan, Shard, every_method
from mpgrasp.bench.playing.player import EpisodeError
from mpgrasp.bench.profiling import forecast as forecasting
from mpgrasp.bench.profiling.forecast import FEWEST, Forecast, Share, forecast
from mpgrasp.bench.record import ErrorLine, Line, Task, line_of
from mpgrasp.suite import load_suite

START = 4.0
MEAN = {"thin": 2.0, "unseen": 3.0, "stacked": 40.0}


def plan(*suites: str, episodes: int = 40) -> Plan:
    methods = every_method(("oracle",), ("mppc", "mvp"))
    return Plan(suites=tuple(map(load_suite, suites)), methods=methods, episodes=episodes)


def duration(task: Task) -> float:
    """Time of an episode: spread by 30 %, and always the same for the same episode [s]."""
    rng = np.random.default_rng([task.episode, len(task.suite), len(task.controller)])
    return float(MEAN[task.suite] * rng.lognormal(-0.045, 0.3))


def makespan(tasks: Iterable[Task], workers: int) -> float:
    """Time of a pool: whoever is free takes the next episode."""
    free = [START] * workers
    for task in tasks:
        heapq.heappush(free, heapq.heappop(free) + duration(task))
    return max(free)


class MadeUpCrew:
    """Plays nothing, and lets a made-up clock go on."""

    losses = 0

    def __init__(self, workers: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.workers, self.played = 0.0, workers, list[Task]()
        self._started = False
        monkeypatch.setattr(time, "monotonic", lambda: self.now)

    def play(self, tasks: Iterable[Task], sink: Callable[[Line], None], note: Callable[[str], None]) -> None:
        if not self._started:
            self.now, self._started = START, True
        for task in tasks:
            self.played.append(task)
            self.now += duration(task)
            which = {name: getattr(task, name) for name in ("suite", "episode", "detector", "controller")}
            sink(line_of(grasp_row(timing={"episode": 1e3 * duration(task)}, **which)))

    def close(self) -> None:
        pass


def told(what: Plan, workers: int, monkeypatch: pytest.MonkeyPatch, limit: float = 1e6) -> Forecast:
    return forecast(what, MadeUpCrew(workers, monkeypatch), workers, limit=limit)


@pytest.mark.parametrize("suites", [("thin",), ("thin", "unseen"), ("thin", "stacked")])
@pytest.mark.parametrize("workers", [1, 2, 8])
def test_a_forecast_is_within_a_fifth_of_what_a_pool_of_workers_takes(
    suites: tuple[str, ...], workers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    what = plan(*suites)
    assert told(what, workers, monkeypatch).time(workers) == pytest.approx(
        makespan(what.tasks(), workers), rel=0.2
    )


def test_a_forecast_is_as_precise_as_it_says_in_most_samples() -> None:
    hits = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        durations = 2.0 * rng.lognormal(-0.045, 0.3, size=200)
        share = Share(episodes=200, seconds=tuple(rng.lognormal(-0.045, 0.3, size=12) * 2.0))
        found = Forecast(shares={"thin": share}, start=0.0)
        hits += abs(found.whole - float(durations.sum())) <= found.half_width
    assert 0.91 <= hits / 200 <= 0.985


def test_more_episodes_are_played_of_what_takes_most_of_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    found = told(plan("thin", "stacked"), 2, monkeypatch)
    played = {name: len(share.seconds) for name, share in found.shares.items()}
    assert played["stacked"] > played["thin"] >= FEWEST
    assert found.half_width <= forecasting.PRECISE * found.whole


def test_after_the_limit_one_episode_of_every_suite_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    found = told(plan("thin", "unseen", "stacked"), 1, monkeypatch, limit=0.0)
    assert [len(share.seconds) for share in found.shares.values()] == [1, 1, 1]
    assert found.time(1) == pytest.approx(makespan(plan("thin", "unseen", "stacked").tasks(), 1), rel=0.8)


def test_the_first_episodes_say_how_long_workers_start_and_nothing_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    crew = MadeUpCrew(2, monkeypatch)
    found = forecast(plan("thin"), crew, 2, limit=1e6)
    assert found.start == pytest.approx(START)
    assert len(crew.played) == len(found.shares["thin"].seconds) + 2


def test_a_shard_takes_its_part_of_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    part = replace(plan("thin"), shard=Shard(2, 4))
    crew = MadeUpCrew(1, monkeypatch)
    found = forecast(part, crew, 1, limit=1e6)
    assert found.shares["thin"].episodes == 20
    assert all(part.has(part.suites[0], task.episode) for task in crew.played)


def test_more_workers_than_episodes_do_not_help() -> None:
    found = Forecast(shares={"thin": Share(episodes=10, seconds=(2.0, 2.0, 2.0))}, start=START)
    assert found.time(1) == pytest.approx(START + 20.0)
    assert found.time(10) == found.time(1000) == pytest.approx(START + 3.0)


def test_an_episode_that_cannot_be_played_ends_a_forecast(monkeypatch: pytest.MonkeyPatch) -> None:
    crew = MadeUpCrew(1, monkeypatch)

    def play(tasks: Iterable[Task], sink: Callable[[Line], None], note: Callable[[str], None]) -> None:
        task = next(iter(tasks))
        row = {"suite": task.suite, "seed": 0, "scene_seed": 1, "episode": 0, "detector": "d"}
        sink(msgspec.convert({**row, "controller": "c", "error": "it fell", "traceback": ""}, ErrorLine))

    crew.play = play  # type: ignore[method-assign]
    with pytest.raises(EpisodeError, match="it fell"):
        forecast(plan("thin"), crew, 1, limit=1e6)
