"""Laws of an episode's random streams."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import combinations

import numpy as np
import pytest

from mpgrasp.episode import seeds

STREAMS: Mapping[str, Callable[[int], np.random.Generator]] = {
    "noise": partial(seeds.noise_rng, tick=0),
    "calibration": seeds.calibration_rng,
    "pattern": seeds.pattern_rng,
    "patches": seeds.patches_rng,
    "force": partial(seeds.force_rng, tick=0),
    "start": seeds.start_rng,
}


@pytest.mark.parametrize("name", STREAMS)
def test_a_stream_repeats_itself_for_a_seed_and_differs_from_seed_to_seed(name: str) -> None:
    drawn = [tuple(STREAMS[name](seed).random(4)) for seed in (0, 1, 2, 2**32 - 1)]
    assert len(set(drawn)) == len(drawn)
    assert drawn[1] == tuple(STREAMS[name](1).random(4))


def test_streams_of_one_seed_are_independent_of_one_another_and_of_the_scene() -> None:
    # a scene's are those of (seed, 0), (seed, 1), ...
    scene = [np.random.default_rng([7, stream]) for stream in range(8)]
    drawn = [rng.normal(size=4000) for rng in (*(make(7) for make in STREAMS.values()), *scene)]
    for one, other in combinations(drawn, 2):
        assert abs(np.corrcoef(one, other)[0, 1]) < 0.1


@pytest.mark.parametrize("make", [seeds.noise_rng, seeds.force_rng])
def test_ticks_differ_and_none_depends_on_those_before(
    make: Callable[[int, int], np.random.Generator],
) -> None:
    drawn = [make(3, tick).random() for tick in range(20)]
    assert len(set(drawn)) == 20
    assert make(3, 19).random() == drawn[19]


def test_every_attempt_of_every_seed_has_a_controller_seed_of_its_own() -> None:
    told = {seeds.controller_seed(seed, attempt) for seed in range(20) for attempt in range(10)}
    assert len(told) == 200
    assert seeds.controller_seed(4, 2) == seeds.controller_seed(4, 2)
    assert not told & set(range(20))


@pytest.mark.parametrize("seed", [0, 5, 2**32 - 1])
def test_streams_are_those_that_published_runs_were_drawn_from(seed: int) -> None:
    drawn = {name: make(seed).random() for name, make in STREAMS.items()}
    numbers = {"noise": 11, "start": 12, "calibration": 15, "pattern": 16, "patches": 17, "force": 18}
    of_tick = {"noise", "force"}
    assert drawn == {
        name: np.random.default_rng([seed, number, 0] if name in of_tick else [seed, number]).random()
        for name, number in numbers.items()
    }
    for attempt, stream in ((0, [seed, 13]), (3, [seed, 13, 3])):
        expected = int(np.random.default_rng(stream).integers(4294967296))
        assert seeds.controller_seed(seed, attempt) == expected


def test_the_first_attempt_is_told_what_a_lone_one_is_told() -> None:
    assert [seeds.controller_seed(seed) for seed in range(5)] == [
        seeds.controller_seed(seed, 0) for seed in range(5)
    ]
