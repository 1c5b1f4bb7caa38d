"""Laws of the stages: each is watched where it is called, all CPU time is in them, nothing stays watched."""

from __future__ import annotations

import functools
import importlib
import time
from collections.abc import Iterator
from typing import Any

import pytest

from mpgrasp.bench.profiling.stages import (
    AFTER,
    BEFORE,
    EXECUTION,
    IMAGE,
    NETWORK,
    PARTS,
    REACH,
    RENDER,
    REST,
    STAGES,
    watched,
)
from mpgrasp.bench.profiling.stopwatch import Stopwatch
from mpgrasp.controllers import make_controller
from mpgrasp.detectors import make_detector
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import run_episode
from mpgrasp.suite import episode_seed, load_suite


def functions() -> Iterator[Any]:
    for paths in STAGES.values():
        for path in paths:
            module, _, name = path.partition(":")
            yield functools.reduce(getattr, name.split("."), importlib.import_module(module))


def play(detector: str, controller: str) -> Any:
    suite = load_suite("thin")
    return run_episode(
        suite.scene_config(0),
        episode_seed("thin", 0, 0),
        detector=make_detector(detector),
        controller=make_controller(controller),
        config=suite.episode_config(camera="ray") if controller != "open_loop" else EpisodeConfig(),
    )


@pytest.fixture(scope="module")
def reached() -> tuple[Stopwatch, float, int]:
    """A reach and a grasp under the watch: the watch, CPU time of all [s], control ticks."""
    watch = Stopwatch()
    with watched(watch):
        start = time.process_time()
        with watch.stage(REST):
            result = play("oracle", "mppc")
        return watch, time.process_time() - start, result.ticks


def test_all_cpu_time_of_an_episode_is_in_its_stages(reached: tuple[Stopwatch, float, int]) -> None:
    watch, whole, _ = reached
    assert watch.total() == pytest.approx(whole, rel=0.02)
    assert sum(watch.total(part=part) for part in PARTS) == pytest.approx(watch.total())


def test_a_stage_begins_as_often_as_what_it_stands_for(reached: tuple[Stopwatch, float, int]) -> None:
    watch, _, ticks = reached
    looks = {(entry.part, entry.stage): calls for entry, calls in watch.calls.items()}
    assert looks[REACH, RENDER] == looks[REACH, "noise"] == looks[REACH, "utility"] == looks[REACH, IMAGE]
    assert looks[REACH, RENDER] in (ticks, ticks + 1)
    assert looks[REACH, "physics"] == looks[REACH, "forces and reflexes"]
    assert looks[EXECUTION, "physics"] > 100  # half a minute of simulated time would be 3,000 ticks of 10 ms
    assert looks[BEFORE, "scene"] == 1
    assert (REACH, NETWORK) not in looks, "the oracle has no network"


def test_no_stage_of_a_reach_takes_no_time(reached: tuple[Stopwatch, float, int]) -> None:
    watch, _, _ = reached
    elsewhere = {NETWORK, "OpenGL set-up", "trace"}  # of a network, of OpenGL, of a run
    assert all(watch.total(stage=stage) > 0 for stage in {*STAGES, REST} - elsewhere)
    assert watch.total(part=AFTER) < 0.2 * watch.total()


def test_a_network_counts_apart_from_its_image_and_its_maps() -> None:
    watch = Stopwatch()
    with watched(watch):
        play("ggcnn2", "open_loop")
    calls = {stage: sum(n for entry, n in watch.calls.items() if entry.stage == stage) for stage in STAGES}
    assert calls[IMAGE] == 1
    assert calls[NETWORK] == 2, "one look, and one run when the network gets ready"
    assert watch.total(stage=NETWORK) > 0
    assert watch.total(stage=IMAGE) > 0


def test_nothing_is_watched_after_the_block_whatever_ends_it() -> None:
    before = [*functions()]

    def fail() -> None:
        with watched(Stopwatch()):
            assert all(a is not b for a, b in zip(before, functions(), strict=True))
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert all(a is b for a, b in zip(before, functions(), strict=True))
