"""Laws of the schedule: rungs follow from results alone, and are where the thresholds are."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mpgrasp.bench.ladders.schedule import Schedule
from mpgrasp.thresholds import Fit, Scale

LEVELS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6)
SCALE = Scale(levels=LEVELS, logarithmic=True, harder="lower")


class Played(dict[float, dict[int, bool]]):
    """Results that are there as soon as somebody asks for a rung."""

    def __init__(self, middle: float, width: float, seed: int) -> None:
        super().__init__()
        self.middle, self.width, self.seed = middle, width, seed

    def get(self, rung: float, default: object = None) -> dict[int, bool]:
        if rung not in self:
            rate = 1 / (1 + np.exp(-2 * np.log(9) / self.width * np.log(rung / self.middle)))
            luck = np.random.default_rng([self.seed, LEVELS.index(rung)]).random(400)
            self[rung] = {k: bool(value < rate) for k, value in enumerate(luck)}
        return self[rung]


def last(schedule: Schedule, results: dict[float, dict[int, bool]]) -> dict[float, int]:
    *_, counts = schedule.counts(results)
    return counts


@pytest.mark.parametrize("episodes", [1, 7, 40, 45, 100, 200])
def test_a_method_plays_as_many_episodes_as_it_is_given(episodes: int) -> None:
    assert sum(last(Schedule(scale=SCALE, episodes=episodes), Played(1.3, 0.8, 0)).values()) == episodes


def test_it_begins_all_over_the_ladder_with_both_ends() -> None:
    counts = next(Schedule(scale=SCALE).counts({}))
    assert {LEVELS[0], LEVELS[-1]} <= counts.keys()
    assert len(counts) == 5
    assert set(counts.values()) == {8}


def test_counts_only_grow_and_by_a_batch_at_a_time() -> None:
    steps = [*Schedule(scale=SCALE).counts(Played(1.3, 0.8, 1))]
    for before, after in itertools.pairwise(steps):
        assert all(after[rung] >= n for rung, n in before.items())
        assert sum(after.values()) - sum(before.values()) == 8


def test_the_same_results_give_the_same_episodes_and_later_ones_change_nothing_before() -> None:
    whole = last(Schedule(scale=SCALE), Played(1.3, 0.8, 2))
    assert whole == last(Schedule(scale=SCALE), Played(1.3, 0.8, 2))
    growing, results = Played(1.3, 0.8, 2), dict[float, dict[int, bool]]()
    for counts in Schedule(scale=SCALE).counts(results):
        for rung, n in counts.items():  # as far as it was played, and no further
            results[rung] = {k: v for k, v in growing.get(rung).items() if k < n}
    assert counts == whole


@pytest.mark.parametrize("middle", [0.9, 1.3, 2.6])
def test_most_episodes_are_played_near_the_thresholds(middle: float) -> None:
    counts = last(Schedule(scale=SCALE), Played(middle, 0.6, 3))
    near = sum(n for rung, n in counts.items() if 0.55 <= rung / middle <= 2.2)
    assert near >= 140


def test_200_episodes_tell_the_levels_to_a_third_of_a_rung() -> None:
    errors: dict[float, list[float]] = {0.5: [], 0.9: []}
    for seed in range(8):
        results = Played(1.3, 0.8, 100 + seed)
        counts = last(Schedule(scale=SCALE), results)
        tally = {r: (sum(v for k, v in results.get(r).items() if k < n), n) for r, n in counts.items()}
        fit = Fit(SCALE, tally)
        for rate, of in errors.items():
            true = 1.3 * np.exp(np.log(rate / (1 - rate)) * 0.8 / (2 * np.log(9)))
            of.append(float(np.log(fit.threshold(rate).level / true)))
    rung = np.log(LEVELS[-1] / LEVELS[0]) / (len(LEVELS) - 1)
    assert all(np.sqrt(np.mean(np.square(of))) < rung / 3 for of in errors.values())


def test_episodes_that_could_not_be_played_count_as_played() -> None:
    results = Played(1.3, 0.8, 5)
    for rung in LEVELS:
        del results.get(rung)[0]
    assert sum(last(Schedule(scale=SCALE), results).values()) == 200
