"""A table is cleared attempt by attempt: what counts is what lies in the basket, and how long that took."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from scripted import Blind, Scripted

from mpgrasp.controllers import make_controller
from mpgrasp.controllers.controller import Observation
from mpgrasp.detectors.oracle import OracleDetector
from mpgrasp.episode.basket import Basket
from mpgrasp.episode.clearing import GUIDED_RATE, Clearing, run_clearing
from mpgrasp.episode.config import ClearingConfig, EpisodeConfig
from mpgrasp.episode.episode import Episode, reach
from mpgrasp.episode.result import ClearingResult, EpisodeResult
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.height_map import HeightMap
from mpgrasp.outcome import Outcome
from mpgrasp.robot import panda
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import ObjectModel, Part

PLANK = ObjectModel(name="plank", parts=(Part(shape="box", size=(0.05, 0.015, 0.015)),), mass=0.05)
TOWER = SceneConfig(
    objects=(PLANK, PLANK),
    placing="stack",
    pattern=((0.0, 0.0, 0.0), (0.0, 0.0, 1.5)),
    cloth_unevenness=0.0,
    basket=True,
)
BARE = np.array([0.42, -0.15, 0.0])
"""Nothing lies there [m]."""
QUICK = ClearingConfig(camera_backend="ray", blind_attempts=2)


class WatchedOracle(OracleDetector):
    """The oracle, which keeps what it is told of the truth."""

    def __init__(self) -> None:
        super().__init__()
        self.truths: list[HeightMap] = []

    def reset(self, truth: HeightMap | None) -> None:
        assert truth is not None
        self.truths.append(truth)
        super().reset(truth)


class Fumbling(Scripted):
    """Is done at once with the next of its grasps, and writes down what it is told and where it starts."""

    def __init__(self, *grasps: Grasp | None, twist: tuple[float, ...] = (0.0,) * 6, ticks: int = 0) -> None:
        super().__init__(twist, ticks=ticks)
        self.grasps = list(grasps)
        self.told: list[list[FloatArray]] = []
        self.seeds: list[int] = []
        self.starts: list[FloatArray] = []

    def reset(self, seed: int) -> None:
        super().reset(seed)
        self.seeds.append(seed)
        self.told.append([])
        self.grasp = self.grasps.pop(0) if self.grasps else None

    def remember_failure(self, position: FloatArray) -> None:
        self.told[-1].append(position)

    def update(self, observation: Observation) -> Any:
        if self.count == 0:
            self.starts.append(observation.T_world_tcp)
        return super().update(observation)


def grasp_at(position: FloatArray) -> Grasp:
    return Grasp(position=position, angle=0.0, width=0.05, quality=0.9)


def fumble(controller: Fumbling, **changes: Any) -> ClearingResult:
    return run_clearing(TOWER, 0, detector=Blind(), controller=controller, config=replace(QUICK, **changes))


@pytest.fixture(scope="module")
def oracle() -> WatchedOracle:
    return WatchedOracle()


@pytest.fixture(scope="module")
def cleared(oracle: WatchedOracle) -> ClearingResult:
    return run_clearing(TOWER, 3, detector=oracle, controller=make_controller("open_loop"), config=QUICK)


def test_the_oracle_clears_a_small_stack_from_the_top(cleared: ClearingResult, oracle: WatchedOracle) -> None:
    assert cleared.outcome is Outcome.SUCCESS
    assert sorted(cleared.in_basket) == ["plank", "plank_2"]
    assert (cleared.left, cleared.knocked_off, cleared.failures) == ((), (), {})
    assert [pick.result.object for pick in cleared.picks] == ["plank_2", "plank"]
    # every attempt was told the truth of its time: the top first, then what is left
    tops = [truth.height.max() for truth in oracle.truths[:2]]
    np.testing.assert_allclose(tops, [0.06, 0.03], atol=0.002)


def test_attempts_fill_the_time_without_gaps(cleared: ClearingResult) -> None:
    times = [time for pick in cleared.picks for time in (pick.start_s, pick.end_s)]
    assert times == sorted(times)
    assert times[0] == 0
    assert times[1] == pytest.approx(times[2])
    assert times[-1] == pytest.approx(cleared.sim_time_s)
    assert all(pick.result.sim_time_s < pick.end_s - pick.start_s for pick in cleared.picks)
    assert cleared.ticks == sum(pick.result.ticks for pick in cleared.picks)


def test_the_same_seed_gives_the_same_clearing_but_for_timing(cleared: ClearingResult) -> None:
    again = run_clearing(
        TOWER, 3, detector=OracleDetector(), controller=make_controller("open_loop"), config=QUICK
    )
    first, second = ({k: v for k, v in r.as_record().items() if k != "timing"} for r in (cleared, again))
    assert first == second


def test_a_clearings_record_is_json_and_has_all_that_a_grasps_has(cleared: ClearingResult) -> None:
    record = cleared.as_record()
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert set(record) >= set(EpisodeResult.__dataclass_fields__) | {"success"}
    assert record["success"] is True
    assert [pick["outcome"] for pick in record["picks"]] == ["success"] * 2


def test_failed_places_are_told_to_the_next_attempts_until_nothing_else_is_left() -> None:
    second = BARE + np.array([0.03, 0.0, 0.0])
    controller = Fumbling(grasp_at(BARE), grasp_at(second))
    result = fumble(controller)
    assert [pick.result.outcome for pick in result.picks[:2]] == [Outcome.MISSED] * 2
    assert [len(told) for told in controller.told] == [0, 1, 2, 0]
    np.testing.assert_array_equal(controller.told[2], [BARE, second])
    assert len(set(controller.seeds)) == len(controller.seeds)
    # in the end nothing was found twice
    assert result.outcome is Outcome.NO_GRASP
    assert result.failures == {"missed": 2, "no_grasp": 2}
    assert sorted(result.left) == ["plank", "plank_2"]
    assert not result.success


def test_a_controller_without_memory_is_not_told() -> None:
    class Forgetful(Scripted):
        def reset(self, seed: int) -> None:
            self.grasp = grasp_at(BARE)

    result = run_clearing(
        TOWER,
        0,
        detector=Blind(),
        controller=Forgetful((0.0,) * 6, ticks=0),
        config=replace(QUICK, time_limit=8),
    )
    assert set(result.failures) == {"missed"}


def test_no_attempt_begins_after_the_time_limit() -> None:
    result = fumble(Fumbling(*[grasp_at(BARE)] * 9), time_limit=9.0)
    assert result.outcome is Outcome.TIMEOUT
    assert [pick.start_s <= 9.0 < pick.end_s for pick in result.picks] == [False, True]
    # the attempt in hand was finished
    assert result.sim_time_s == pytest.approx(result.picks[-1].end_s)
    assert result.failures == {"missed": 2}


def test_a_stop_costs_its_recovery_and_the_next_attempt_begins_at_the_start() -> None:
    controller = Fumbling(twist=(3.0, 0.0, 0.0, 0.0, 0.0, 0.0), ticks=1000)
    result = fumble(controller, time_limit=4.5, recovery_time=2.0)
    assert result.picks[0].result.outcome is Outcome.REFLEX
    assert len(result.stops) >= len(result.picks)
    assert all(pick.end_s - pick.start_s > 2.0 for pick in result.picks)
    assert len(controller.starts) >= 2
    np.testing.assert_allclose(controller.starts[1], controller.starts[0], atol=2e-3)


class Rushing(Fumbling):
    """Drives into a stop with its grasp in mind: the first of its grasps that it was not told has failed."""

    def __init__(self, *wishes: Grasp) -> None:
        super().__init__(twist=(3.0, 0.0, 0.0, 0.0, 0.0, 0.0), ticks=1000)
        self.wishes = wishes
        self.chosen: list[Grasp | None] = []
        self.last_views: list[FloatArray] = []

    def update(self, observation: Observation) -> Any:
        if self.count == 0:
            self.last_views.append(np.zeros(3))
        self.last_views[-1] = observation.grasp_map.T_world_camera[:3, 3]
        return super().update(observation)

    def final_grasp(self) -> Grasp | None:
        told = self.told[-1]
        left = (w for w in self.wishes if not any(np.array_equal(w.position, place) for place in told))
        self.chosen.append(next(left, None))
        return self.chosen[-1]


def test_the_grasp_of_a_stopped_reach_is_remembered_and_another_is_tried() -> None:
    one, other = grasp_at(BARE), grasp_at(BARE + np.array([0.1, 0.05, 0.0]))
    controller = Rushing(one, other)
    result = fumble(controller, time_limit=9.0, recovery_time=1.0)
    assert len(result.picks) >= 3
    assert {pick.result.outcome for pick in result.picks} == {Outcome.REFLEX}
    assert all(pick.result.grasp is None for pick in result.picks)
    assert controller.chosen[:3] == [one, other, None]
    np.testing.assert_array_equal(controller.told[2], [one.position, other.position])


def test_of_a_stopped_reach_without_a_grasp_the_place_under_the_camera_is_remembered() -> None:
    controller = Rushing()
    fumble(controller, time_limit=4.5, recovery_time=1.0)
    (place,) = controller.told[1]
    np.testing.assert_array_equal(place, [*controller.last_views[0][:2], 0.0])


@pytest.mark.parametrize("yaw", [-1.8, 1.8])
def test_the_arm_carries_and_returns_without_a_stop_however_it_has_grasped(yaw: float) -> None:
    episode = Episode(TOWER, 0, detector=Blind(), config=QUICK)
    clearing, driver = Clearing(episode, Fumbling(), QUICK), episode.driver
    start = driver.T_desired
    for x, y in ((0.6, -0.15), (0.4, 0.15)):
        driver.move_to(looking_down([x, y, 0.25], yaw))
        clearing._carry()
        np.testing.assert_allclose(driver.T_desired[:2, 3], clearing.basket.centre, atol=0.06)
        clearing._return()
        np.testing.assert_allclose(driver.T_desired, start, atol=1e-6)
    episode.close()
    assert clearing.stops == []


def test_an_arm_that_nothing_else_moves_is_guided_home() -> None:
    episode = Episode(TOWER, 0, detector=Blind(), config=QUICK)
    clearing, start = Clearing(episode, Fumbling(), QUICK), episode.driver.T_desired
    episode.simulation.set_q(panda.Q_HOME + np.array([0.8, 0.1, -0.9, 0.3, 0.5, 0.2, 1.0]))
    episode.driver.reset()
    clearing._guide_home()
    episode.close()
    np.testing.assert_allclose(episode.driver.T_desired, start, atol=2e-3)
    assert clearing.time > 1.0 / GUIDED_RATE


def test_what_fell_off_the_table_is_not_waited_for_and_does_not_count_as_cleared() -> None:
    episode = Episode(TOWER, 0, detector=Blind(), config=QUICK)
    data, model = episode.simulation.data, episode.scene.model
    basket = Basket(episode.scene)
    for name, place in (("plank", [1.5, 0.0, -0.7]), ("plank_2", [*basket.centre, 0.03])):
        data.qpos[model.joint(f"{name}/free").qposadr[0] :][:3] = place
    mujoco.mj_forward(model, data)
    result = Clearing(episode, Fumbling(), QUICK).play()
    episode.close()
    assert (result.outcome, result.success) == (Outcome.KNOCKED_OFF, False)
    assert (result.knocked_off, result.in_basket, result.picks) == (("plank",), ("plank_2",), ())


def test_what_is_lifted_and_lost_on_the_way_is_dropped() -> None:
    # the hand opens where no basket is
    episode = Episode(TOWER, 3, detector=OracleDetector(), config=QUICK)
    clearing = Clearing(episode, make_controller("open_loop"), QUICK)
    clearing.basket.centre = np.array([0.45, 0.25])
    clearing.basket._half = np.zeros(2)
    clearing.begin()
    pick = clearing.take(reach(episode, clearing.controller))
    episode.close()
    assert pick.result.outcome is Outcome.DROPPED
    assert pick.result.object == "plank_2"


def test_the_basket_holds_what_is_above_its_floor_and_within_its_walls() -> None:
    episode = Episode(TOWER, 0, detector=Blind(), config=QUICK)
    basket = Basket(episode.scene)
    episode.close()
    np.testing.assert_allclose(basket.centre, [0.35, 0.52])
    inside = np.array([*basket.centre, 0.02])
    assert basket.holds(inside)
    assert basket.holds(inside + np.array([0.12, -0.09, 0.1]))
    assert not basket.holds(inside + np.array([0.14, 0.0, 0.0]))
    assert not basket.holds(inside + np.array([0.0, 0.11, 0.0]))
    assert not basket.holds(inside - np.array([0.0, 0.0, 0.1]))


def test_clearing_without_a_basket_is_refused() -> None:
    with pytest.raises(ConfigError, match="basket"):
        run_clearing(replace(TOWER, basket=False), 0, detector=Blind(), controller=Fumbling(), config=QUICK)


@pytest.mark.parametrize(
    "settings",
    [
        {"time_limit": 0.0},
        {"blind_attempts": 0},
        {"recovery_time": -1.0},
        {"carry_speed": 0.0},
        {"control_dt": 0},
    ],
)
def test_unusable_settings_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        ClearingConfig(**settings)


def test_a_clearing_runs_like_a_grasp_apart_from_what_is_its_own() -> None:
    ours, theirs = ClearingConfig(), EpisodeConfig()
    shared = set(EpisodeConfig.__dataclass_fields__) - {"execution"}
    assert all(getattr(ours, name) == getattr(theirs, name) for name in shared)
