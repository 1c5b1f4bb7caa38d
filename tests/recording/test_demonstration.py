"""Laws of demonstrations: they are the episode, and played in the environment they are it again."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.controllers import make_controller
from mpgrasp.detectors import make_detector
from mpgrasp.env import GraspEnv
from mpgrasp.episode.episode import run_episode
from mpgrasp.episode.result import EpisodeResult
from mpgrasp.exceptions import ConfigError
from mpgrasp.recording.demonstration import Demonstration, DemonstrationRecorder
from mpgrasp.recording.policy_view import ACTION_SCALE, action_of, twist_of
from mpgrasp.suite import episode_seed, load_suite

EPISODE = 2


@pytest.fixture(scope="module")
def played() -> tuple[EpisodeResult, Demonstration]:
    suite, recorder = load_suite("thin"), DemonstrationRecorder()
    result = run_episode(
        suite.scene_config(EPISODE),
        episode_seed("thin", 0, EPISODE),
        detector=make_detector("oracle"),
        controller=make_controller("mppc"),
        config=suite.episode_config(),
        recorder=recorder,
    )
    return result, recorder.demonstration(success=result.success)


def test_a_demonstration_has_a_row_for_every_look_but_the_last(
    played: tuple[EpisodeResult, Demonstration],
) -> None:
    result, made = played
    assert len(made) == result.ticks - 1
    assert {len(values) for values in made.observations.values()} == {len(made)}
    assert made.observations["depth"].shape[1:] == (224, 224)
    assert made.rewards.tolist() == [0.0] * (len(made) - 1) + [1.0]
    assert made.dones.sum() == 1
    assert made.dones[-1]


def test_its_actions_played_in_the_environment_are_the_episode_again(
    played: tuple[EpisodeResult, Demonstration],
) -> None:
    _, made = played
    env = GraspEnv("thin", detector="oracle")
    seen, _ = env.reset(options={"episode": EPISODE})
    for k, action in enumerate(made.actions):
        for name, value in seen.items():
            # single precision of the actions moves the arm by micrometres, and hardly a pixel
            close = np.abs(value - made.observations[name][k]) < 2e-3
            assert close.mean() > 0.99, (k, name)
        seen, reward, terminated, _, info = env.step(action)
    assert terminated
    assert reward == 1.0
    assert info["outcome"] == "success"
    env.close()


def test_joints_and_tool_are_those_before_the_action(played: tuple[EpisodeResult, Demonstration]) -> None:
    _, made = played
    tcp, time = made.observations["tcp"], made.observations["time"][:, 0]
    np.testing.assert_allclose(time, 0.1 * np.arange(len(made)), atol=1e-6)
    # the arm begins at rest where the suite says, and the ramp takes it to what was asked for
    assert tcp[0, 2] == pytest.approx(0.5, abs=1e-3)
    asked = made.actions[:, 2] * ACTION_SCALE[2]
    np.testing.assert_allclose(np.diff(tcp[:, 2])[5:] / 0.1, asked[5:-1], atol=5e-3)


def test_actions_and_twists_are_each_other_s_inverse_within_the_box() -> None:
    rng = np.random.default_rng(0)
    for action in rng.uniform(-1, 1, (20, 4)):
        np.testing.assert_allclose(action_of(twist_of(action)), action, atol=1e-6)
    assert action_of(np.array([1.0, 0, 0, 0, 0, -9.0])).tolist() == [1, 0, 0, -1]


def test_an_episode_without_a_reach_teaches_nothing() -> None:
    with pytest.raises(ConfigError, match="nothing to learn"):
        DemonstrationRecorder().demonstration(success=False)
