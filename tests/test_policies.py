"""A learned policy is a controller like any other, and does in the benchmark what it does when learning."""

from __future__ import annotations

import hashlib
import json
import warnings
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3 import DQN, PPO, SAC, TD3
from stable_baselines3.common.env_checker import check_env

from mpgrasp.bench.__main__ import main
from mpgrasp.controllers.controller import Controller
from mpgrasp.detectors import make_detector
from mpgrasp.env import GraspEnv
from mpgrasp.env_spaces import space_of
from mpgrasp.episode.episode import run_episode
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import GraspMap
from mpgrasp.plugins import load_controller
from mpgrasp.recording.policy_view import IMAGE, RELIEF, pictured
from mpgrasp.suite import episode_seed, load_suite

SUITE = "find_stick"


class Spaces(gymnasium.Env[Any, Any]):
    """An environment that is nothing but its spaces."""

    def __init__(self, observations: spaces.Space[Any], actions: spaces.Space[Any]) -> None:
        self.observation_space, self.action_space = observations, actions


OURS = space_of("images", 30.0), spaces.Box(-1.0, 1.0, (4,), np.float32)


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained policy, but for a wish to come down."""
    file = tmp_path_factory.mktemp("policies") / "downwards.zip"
    model: Any = PPO("MultiInputPolicy", Spaces(*OURS), seed=0, device="cpu", n_steps=2, batch_size=2)
    model.policy.action_net.weight.data *= 30  # so that it matters what is seen
    model.policy.action_net.bias.data[2] = -0.8
    model.save(file)
    return file


def test_stable_baselines_has_nothing_to_complain_about() -> None:
    env = GraspEnv(SUITE, observations="images")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)
    env.close()


def test_a_policy_ends_an_episode_in_the_benchmark_as_in_its_environment(policy: Path) -> None:
    env, model = GraspEnv(SUITE, observations="images"), PPO.load(policy, device="cpu")
    actions = []
    observed, info = env.reset(options={"episode": 1})
    over = False
    while not over:
        actions.append(model.predict(observed, deterministic=True)[0])
        observed, _, over, _, info = env.step(actions[-1])
    env.close()
    suite = load_suite(SUITE)
    played = run_episode(
        suite.scene_config(1), episode_seed(SUITE, 0, 1), detector=make_detector("oracle"),
        controller=load_controller(f"sb3:{policy}"), config=suite.episode_config(),
    )  # fmt: skip
    assert np.ptp(actions, axis=0).max() > 1e-3
    assert played.state_hash == info["result"].state_hash
    assert played.outcome == info["result"].outcome


def test_the_benchmark_plays_a_policy_and_says_which(policy: Path, tmp_path: Path) -> None:
    words = [SUITE, "--detector", "oracle", "--controller", f"sb3:{policy}", "--episodes", "1"]
    assert main([*words, "--workers", "0", "--quiet", "--no-report", "--out", str(tmp_path / "run")]) == 0
    (line,) = (tmp_path / "run" / "episodes.jsonl").read_text().splitlines()
    assert json.loads(line)["controller"] == f"sb3:{policy}"
    assert hashlib.sha256(policy.read_bytes()).hexdigest() in (tmp_path / "run" / "run.json").read_text()


def test_it_keeps_what_controllers_of_a_table_to_be_cleared_are_told(policy: Path) -> None:
    controller: Any = load_controller(f"sb3:{policy}")
    controller.reset(3)
    controller.remember_failure(np.array([0.5, 0.0, 0.0]))
    assert controller._mppc.grid.failures.any()
    typed: Controller = controller
    assert typed.name == "sb3 downwards"


def test_a_suite_s_height_of_the_end_is_the_policy_s(policy: Path) -> None:
    controller: Any = load_controller(f"sb3:{policy}", {"z_min": 0.21})
    assert controller._mppc.config.z_min == controller.config["z_min"] == 0.21
    with pytest.raises(ConfigError, match="unusable heights"):
        load_controller(f"sb3:{policy}", {"z_min": 0.7})


@pytest.mark.parametrize("algorithm", [SAC, TD3])
def test_policies_of_other_algorithms_steer_too(algorithm: Any, tmp_path: Path) -> None:
    model = algorithm("MultiInputPolicy", Spaces(*OURS), buffer_size=1, device="cpu")
    model.save(tmp_path / "other.zip")
    assert load_controller(f"sb3:{tmp_path / 'other.zip'}").final_grasp() is None


def test_files_that_are_no_policy_for_this_are_refused(tmp_path: Path) -> None:
    def refused(name: str) -> str:
        with pytest.raises(ConfigError) as told:
            load_controller(f"sb3:{tmp_path / name}")
        return str(told.value)

    assert "no such file of a policy" in refused("none.zip")
    (tmp_path / "text.zip").write_text("no archive")
    assert "no policy of stable-baselines3" in refused("text.zip")
    with zipfile.ZipFile(tmp_path / "empty.zip", "w"):
        pass
    assert "what model.save(file) wrote" in refused("empty.zip")
    DQN("MultiInputPolicy", Spaces(OURS[0], spaces.Discrete(3)), buffer_size=1).save(tmp_path / "dqn.zip")
    assert "a policy that cannot steer here" in refused("dqn.zip")
    other = Spaces(spaces.Box(-1, 1, (3,), np.float32), OURS[1])
    PPO("MlpPolicy", other, device="cpu", n_steps=2, batch_size=2).save(tmp_path / "flat.zip")
    assert "a policy of another environment" in refused("flat.zip")
    whole = (tmp_path / "dqn.zip").read_bytes()
    (tmp_path / "half.zip").write_bytes(whole[: len(whole) // 2])
    assert "no policy of stable-baselines3" in refused("half.zip")


def test_pictures_show_heights_about_the_median_and_quality() -> None:
    env = GraspEnv(SUITE, "oracle")
    env.reset(options={"episode": 0})
    assert env._episode is not None
    view = env._episode.look()
    env.close()
    seen = pictured(view.grasp_map, view.T_world_tcp, 15.0)
    image: Any = seen["image"]
    state: Any = seen["state"]
    assert (image.shape, image.dtype, state.dtype) == ((2, IMAGE, IMAGE), np.uint8, np.float32)
    assert abs(int(np.median(image[0])) - 128) <= 1
    # an image of one level, but for a block a quarter of the scale higher, a hundred pixels broad
    block = view.grasp_map.depth.copy()
    block[:] = 0.4
    block[60:160, 60:160] -= RELIEF / 4
    raised = pictured(_with_depth(view.grasp_map, block), view.T_world_tcp, 15.0)["image"][0]
    assert (raised == 128).mean() > 0.7
    assert raised.max() == round(255 * 0.625)
    np.testing.assert_allclose(state[2], view.T_world_tcp[2, 3], atol=1e-6)
    np.testing.assert_allclose(state[3] ** 2 + state[4] ** 2, 1.0, atol=1e-6)
    assert state[5] == 0.5
    nothing = _with_depth(view.grasp_map, np.full_like(block, np.nan))
    assert (pictured(nothing, view.T_world_tcp, 0.0)["image"][0] == 128).all()


def _with_depth(grasp_map: GraspMap, depth: np.ndarray) -> GraspMap:
    return replace(grasp_map, depth=depth)
