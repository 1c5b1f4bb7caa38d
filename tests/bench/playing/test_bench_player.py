from __future__ import annotations

from typing import Any

import fakes
import pytest
from bench_plans import CONTROLLER, make_plan

from mpgrasp.bench.playing.player import Player
from mpgrasp.exceptions import ConfigError


class Compiled(fakes.FakeDetector):
    name = "compiled"
    calls = 0

    @property
    def readiness(self) -> str:
        return f"compiled: ready in {self.calls} s"

    def warm_up(self) -> float:
        self.calls += 1
        return float(self.calls)


class Colourful(fakes.FakeDetector):
    name = "colourful"
    reads_colour = True


def player(detector: str, **settings: Any) -> Player:
    plan = make_plan(detectors=(f"{__name__}:{detector}",), controllers=(CONTROLLER,), **settings)
    return Player(plan, fakes.run_episode)


def test_what_compiles_does_so_before_the_first_episode_and_says_what_it_took() -> None:
    assert player("Compiled").prepare() == ["compiled: ready in 1 s"]


def test_what_does_not_compile_says_nothing() -> None:
    assert Player(make_plan(), fakes.run_episode).prepare() == []


def test_colour_is_refused_before_the_first_episode_where_rays_are_cast() -> None:
    with pytest.raises(ConfigError, match=r"reads colour, which takes OpenGL.*camera ray"):
        player("Colourful", camera="ray").prepare()
