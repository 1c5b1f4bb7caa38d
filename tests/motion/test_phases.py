"""Phases of an execution are played in order, up to a protective stop, and any may be replaced."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi

from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.execution_state import ExecutionState, Phase
from mpgrasp.motion.phases import PHASES, descend, pregrasp, shake
from mpgrasp.robot.hand import FINGERTIP_BEYOND_TCP

GRASP = Grasp(position=np.array([0.5, 0.1, 0.06]), angle=0.0, width=0.03, quality=1.0)


class PlainDriver:
    """Arrives at once wherever it is sent; feels the ground when its tips would be below `ground` [m]."""

    def __init__(self, z: float = 0.4, ground: float = -1.0) -> None:
        self.T_desired, self.ground = looking_down([0.5, 0.1, z]), ground
        self.reflex: Any = None
        self.touch = 0.0
        self.moves: list[tuple[float, float]] = []
        self.widths: list[float] = []
        self.paths: list[FloatArray] = []
        self.simulation: Any = SimpleNamespace(
            time=0.0,
            scene=SimpleNamespace(objects=()),
            open_gripper=self.widths.append,
        )

    def move_to(
        self,
        T_world_tcp: FloatArray,
        max_speed: float,
        *,
        until: Callable[[], bool] | None = None,
        deceleration: float | None = None,
        on_tick: Callable[[Any], None] | None = None,
    ) -> bool:
        target, lowest = T_world_tcp.copy(), self.ground + FINGERTIP_BEYOND_TCP
        self.touch = 10.0 if target[2, 3] < lowest else 0.0
        target[2, 3] = max(target[2, 3], lowest)
        self.T_desired = self.simulation.T_world_tcp = target
        self.moves.append((float(target[2, 3]), max_speed))
        if on_tick is not None:
            on_tick(self)
        return until is None or not until()

    def wait(self, *_: Any, **__: Any) -> None: ...

    def follow(self, path: Callable[[float], FloatArray], duration: float, _: Any = None) -> None:
        self.paths.append(np.array([path(t) for t in np.linspace(0.0, duration, 500)]))


def state_by(driver: PlainDriver, **changes: Any) -> ExecutionState:
    return ExecutionState(driver, GRASP, ExecutionConfig(), yaw=0.0, **changes)


def test_phases_are_played_in_order_and_each_tick_is_told_its_own() -> None:
    told: list[str] = []

    def two_moves(state: ExecutionState) -> None:
        state.rise(0.01, 0.1)
        state.rise(0.01, 0.1)

    state_by(PlainDriver(), on_tick=told.append).play({"first": two_moves, "then": two_moves})
    assert told == ["first", "first", "then", "then"]


def test_nothing_is_played_after_a_protective_stop() -> None:
    driver, played = PlainDriver(), []

    def stopped(state: ExecutionState) -> None:
        played.append(state.phase)
        driver.reflex = "contact_force"

    phases: dict[str, Phase] = {**PHASES, "descend": stopped}
    state = state_by(driver)
    state.play(phases)
    assert (played, state.phase) == (["descend"], "descend")


def test_what_was_lifted_is_shaken_along_and_across_the_closing_direction_and_up_and_down() -> None:
    assert list(PHASES) == ["pregrasp", "descend", "close", "lift", "hold", "shake"]
    c = ExecutionConfig()
    driver = PlainDriver()
    shake(state_by(driver))
    sideways, upright = driver.paths
    for path in (sideways, upright):  # faded in and out: the whole amplitude is only nearly reached
        assert 0.85 < np.linalg.norm(path, axis=1).max() / c.shake_amplitude <= 1.0
        np.testing.assert_allclose(path[[0, -1]], 0.0, atol=1e-6)
    along, across, up = np.abs(sideways).max(axis=0)
    assert along == pytest.approx(across, rel=0.01)
    assert along > 0.5 * c.shake_amplitude
    assert up == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(upright[:, :2], 0.0, atol=1e-9)


def test_the_tool_comes_down_onto_the_pregrasp_from_wherever_it_is() -> None:
    c = ExecutionConfig()
    for start, ways in ((0.4, 1), (0.05, 2)):  # from below it rises first
        driver = PlainDriver(z=start)
        pregrasp(state_by(driver))
        assert len(driver.moves) == ways
        assert driver.widths == [pytest.approx(0.03 + c.opening_margin)]
        assert all(z == pytest.approx(0.06 + c.approach) for z, _ in driver.moves)


def test_the_descent_slows_down_and_ends_as_deep_as_the_palm_allows() -> None:
    driver, c = PlainDriver(), ExecutionConfig()
    state = state_by(driver)
    descend(state)
    heights = [z - FINGERTIP_BEYOND_TCP for z, _ in driver.moves]
    assert heights == pytest.approx([0.06 + c.entry_height, 0.06 - c.palm_depth])
    assert [speed for _, speed in driver.moves] == [c.descent_speed, c.entry_speed]
    assert state.contact_height is None
    assert state.tip_height == pytest.approx(0.06 - c.palm_depth)


def test_a_descent_that_feels_something_backs_off_a_little() -> None:
    driver, c = PlainDriver(ground=0.03), ExecutionConfig()
    state = state_by(driver)
    descend(state)
    assert state.contact_height == pytest.approx(0.03)
    assert state.tip_height == pytest.approx(0.03 + c.back_off)
    assert len(driver.moves) == 3


class ShakyDriver(PlainDriver):
    """Goes down in ticks of a hundredth of a second and feels nothing but its noise."""

    def move_to(
        self,
        T_world_tcp: FloatArray,
        max_speed: float,
        *,
        until: Callable[[], bool] | None = None,
        deceleration: float | None = None,
        on_tick: Callable[[Any], None] | None = None,
    ) -> bool:
        way = self.T_desired[2, 3] - T_world_tcp[2, 3]
        self.T_desired = self.simulation.T_world_tcp = T_world_tcp.copy()
        ticks = round(abs(way) / max_speed / 0.01)
        self.moves += [(float(T_world_tcp[2, 3]), max_speed)] * ticks
        return until is None or not any(until() for _ in range(ticks))


def test_a_false_contact_is_as_likely_as_the_tail_of_the_noise_says() -> None:
    """Noise of s on three axes has a length beyond r with the probability of a chi distribution's tail."""
    config = ExecutionConfig(force_noise=1.0, contact_threshold=3.5)
    false, n, samples = 0, 400, 0
    for seed in range(n):
        driver = ShakyDriver(z=0.12)
        state = ExecutionState(driver, GRASP, config, yaw=0.0, rng=np.random.default_rng(seed))
        descend(state)
        false += state.contact_height is not None
        samples = max(samples, len(driver.moves))
    expected = 1 - (1 - chi(3).sf(3.5)) ** samples
    assert 0.1 < expected < 0.9
    assert false / n == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / n))


def test_without_noise_the_force_is_felt_as_it_is_and_nothing_is_drawn() -> None:
    rng = np.random.default_rng(0)
    driver = PlainDriver()
    state = state_by(driver, rng=rng)
    driver.touch = 1.25
    assert state.felt() == 1.25
    assert rng.bit_generator.state == np.random.default_rng(0).bit_generator.state


def test_a_force_is_felt_as_the_length_of_its_sum_with_the_noise() -> None:
    driver = PlainDriver()
    config = ExecutionConfig(force_noise=0.5)
    state = ExecutionState(driver, GRASP, config, yaw=0.0, rng=np.random.default_rng(2))
    driver.touch = 3.0
    squares = np.square([state.felt() for _ in range(4000)])
    # |f + n|^2 = f^2 + 3 s^2 on average
    assert squares.mean() == pytest.approx(9.0 + 3 * 0.25, rel=0.03)
