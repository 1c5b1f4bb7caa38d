"""Laws of commands on their way."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping

import numpy as np
import pytest

from mpgrasp.controllers.controller import Command, Observation
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors import make_detector
from mpgrasp.detectors.central_square import empty_map
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import Episode, run_episode
from mpgrasp.episode.latency import CommandQueue, Span
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.height_map import HeightMap
from mpgrasp.scene.config import SceneConfig


def command(k: int, done: bool = False) -> Command:
    return Command(twist=np.full(6, float(k)), gripper=0.08, done=done)


def played(delays: list[int], ticks: int = 10) -> list[float]:
    """Number of the command that acts in each tick of the velocity loop; NaN before the first."""
    queue, acting = CommandQueue(), []
    for k, delay in enumerate(delays):
        for span in queue.spans(command(k, done=k == len(delays) - 1), delay, ticks):
            acting += [np.nan if span.command is None else span.command.twist[0]] * span.ticks
    return acting


@pytest.mark.parametrize("delay", [0, 3, 10, 14, 37])
def test_what_is_decided_acts_so_much_later(delay: int) -> None:
    n = 8
    acting = played([delay] * n)
    expected = [np.nan] * delay + [k for k in range(n - 1) for _ in range(10)]
    assert len(acting) == 10 * (n - 1) + delay
    np.testing.assert_array_equal(acting, expected[: len(acting)])


def test_a_command_that_is_late_holds_up_those_behind_it() -> None:
    assert played([0, 25, 0, 0, 0, 0])[10:] == [0.0] * 25 + [3.0] * 5 + [4.0] * 0 + [3.0] * 0 + [4.0] * 10


def test_without_latency_a_tick_is_one_span() -> None:
    queue, first = CommandQueue(), command(0)
    assert list(queue.spans(first, 0, 10)) == [Span(first, 10)]
    assert list(queue.spans(command(1, done=True), 0, 10)) == []


class Forwards:
    """Controller that moves along x at one speed, then stops."""

    name = "forwards"

    def __init__(self, ticks: int = 6) -> None:
        self.ticks, self.k = ticks, 0

    def reset(self, seed: int) -> None:
        self.k = 0

    def update(self, observation: Observation) -> Command:
        self.k += 1
        twist = np.array([0.05, 0, 0, 0, 0, 0])
        return Command(twist=twist, gripper=0.08, done=self.k > self.ticks)

    def final_grasp(self) -> Grasp | None:
        return None

    def diagnostics(self) -> Mapping[str, FloatArray | float | bool]:
        return {}


class Slow:
    """Detector that finds nothing and takes its time."""

    name = "slow"

    def reset(self, truth: HeightMap | None) -> None: ...

    def predict(self, frame: DepthFrame) -> GraspMap:
        time.sleep(0.12)
        return empty_map(frame)


def config(latency: float | str) -> EpisodeConfig:
    plain = EpisodeConfig(camera_backend="ray", noise=False)
    return dataclasses.replace(plain, camera=dataclasses.replace(plain.camera, latency=latency, crop=64))  # type: ignore[arg-type]


def test_a_constant_motion_is_shifted_by_the_latency() -> None:
    """The arm goes on while the command to stop is on its way, so that it ends where it would have ended."""
    ends = {}
    for latency in (0.0, 0.15):
        result = run_episode(SceneConfig(), 0, detector=Slow(), controller=Forwards(), config=config(latency))
        ends[latency] = result
    assert ends[0.15].sim_time_s - ends[0.0].sim_time_s == pytest.approx(0.15, abs=1e-9)
    assert ends[0.15].path_length_m == pytest.approx(ends[0.0].path_length_m, abs=5e-4)


def test_a_measured_latency_is_the_detectors_own_time() -> None:
    result = run_episode(SceneConfig(), 0, detector=Slow(), controller=Forwards(3), config=config("measured"))
    assert 0.3 + 0.115 <= result.sim_time_s <= 0.3 + 0.2


def test_the_oracle_errs_by_the_calibration_like_all_others() -> None:
    plain = config(0.0)
    off = dataclasses.replace(
        plain, camera=dataclasses.replace(plain.camera, crop=200, calibration_translation=0.03)
    )
    good = dataclasses.replace(plain, camera=dataclasses.replace(plain.camera, crop=200))
    found = {}
    for name, settings in (("off", off), ("good", good)):
        episode = Episode(SceneConfig(), 4, detector=make_detector("oracle"), config=settings)
        view = episode.look().grasp_map
        k = np.unravel_index(np.argmax(view.quality), view.quality.shape)
        found[name] = k, view.world_points()[k]
        episode.close()
    assert found["off"][0] == found["good"][0]
    assert np.linalg.norm(found["off"][1] - found["good"][1]) == pytest.approx(0.03, abs=1e-6)
