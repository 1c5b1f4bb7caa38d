"""The clearing environment is the benchmark's own clearing, stepped by someone else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from scripted import Blind

from mpgrasp.clear_env import ClearEnv
from mpgrasp.controllers import make_controller
from mpgrasp.detectors import make_detector
from mpgrasp.env import GraspEnv
from mpgrasp.episode.clearing import run_clearing
from mpgrasp.episode.config import ClearingConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.suite import Suite, episode_seed, parse_suite

DECLARED = {
    "title": "Two planks, one across the other",
    "trial": "clear",
    "scene": {
        "objects": [
            {"name": name, "box": [0.1, 0.03, 0.03], "density": 500.0} for name in ("below", "above")
        ],
        "placing": "stack",
        "pattern": [[0.0, 0.0, 0.0], [0.0, 0.0, 1.5]],
        "cloth_unevenness": 0.0,
        "basket": True,
    },
    "episode": {"start_height": 0.25, "blind_attempts": 1},
}
DOWN = np.array([0.0, 0.0, -1.0, 0.0])


@pytest.fixture
def suite() -> Suite:
    return parse_suite("planks", DECLARED)


def play(env: ClearEnv, most: int = 400) -> tuple[list[float], list[str], dict[str, Any]]:
    """Rewards of the attempts, their outcomes, and the last info, with the actions of MP-PC."""
    rewards, picks = [], []
    _, info = env.reset(options={"episode": 0})
    for _ in range(most):
        observed, reward, terminated, truncated, info = env.step(info["mppc_action"])
        assert observed in env.observation_space
        assert not truncated
        if "pick" in info:
            rewards.append(reward)
            picks.append(info["pick"])
            if not terminated:  # the next attempt has begun
                assert float(observed["time"][0]) == 0.0
        else:
            assert reward == 0.0
        if terminated:
            return rewards, picks, info
    raise AssertionError(f"no end in {most} steps")


def test_with_the_actions_of_mppc_a_table_is_cleared_as_in_the_benchmark(suite: Suite) -> None:
    env = ClearEnv(suite)
    rewards, picks, info = play(env)
    env.close()
    config = suite.episode_config()
    assert isinstance(config, ClearingConfig)
    expected = run_clearing(
        suite.scene_config(0), episode_seed("planks", 0, 0), detector=make_detector("oracle"),
        controller=make_controller("mppc"), config=config,
    )  # fmt: skip
    result = info["result"]
    assert [pick.result.outcome.value for pick in expected.picks] == picks
    assert (result.outcome, result.in_basket, result.ticks) == (
        expected.outcome,
        expected.in_basket,
        expected.ticks,
    )
    assert result.sim_time_s == pytest.approx(expected.sim_time_s, abs=0.05)
    assert sum(rewards) == len(expected.in_basket) == 2
    assert info["is_success"] is True
    assert info["outcome"] == "success"


def test_an_attempt_that_is_stopped_costs_time_and_not_the_episode(suite: Suite) -> None:
    env = ClearEnv(suite)
    env.reset(options={"episode": 0})
    for _ in range(60):
        *_, terminated, _, info = env.step(np.array([1.0, 0.0, 0.0, 0.0]))
        if "pick" in info:
            break
    env.close()
    assert info["pick"] == "reflex"
    assert info["reflex"]
    assert not terminated
    assert "result" not in info


def test_a_table_that_is_not_clear_in_time_is_a_failure(suite: Suite) -> None:
    config = suite.episode_config()
    assert isinstance(config, ClearingConfig)
    env = ClearEnv(suite, Blind(), replace(config, time_limit=2.0))
    env.reset(options={"episode": 0})
    for _ in range(60):
        _, reward, terminated, _, info = env.step(DOWN)
        if terminated:
            break
    assert (reward, info["is_success"], info["outcome"]) == (0.0, False, "timeout")
    assert (len(info["result"].picks), info["result"].left) == (1, ("below", "above"))
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(DOWN)
    env.close()


def test_single_grasps_are_refused() -> None:
    with pytest.raises(ConfigError, match='a suite of trial "clear", such as stacked'):
        ClearEnv("thin")
    with pytest.raises(ConfigError, match="ClearingConfig"):
        ClearEnv("stacked", config=GraspEnv("thin").config)


def test_gymnasium_makes_it_by_name() -> None:
    env = gymnasium.make("mpgrasp/Clear-v0")
    assert isinstance(env.unwrapped, ClearEnv)
    assert isinstance(env.unwrapped.config, ClearingConfig)
    env.close()
