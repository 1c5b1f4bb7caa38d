"""The gymnasium environment is the benchmark's own episode, stepped by someone else."""

from __future__ import annotations

import subprocess
import sys
import threading
import tomllib
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.camera.rasteriser import require_gl
from mpgrasp.controllers import make_controller
from mpgrasp.controllers.config import MPPC
from mpgrasp.depth import DepthFrame, crop_resize, inpaint
from mpgrasp.detectors import make_detector
from mpgrasp.detectors.config import OracleConfig
from mpgrasp.detectors.oracle import OracleDetector
from mpgrasp.env import ACTION_SCALE, FIRST_TRAINING_EPISODE, GraspEnv
from mpgrasp.env_ids import NAMESPACE, SUITES
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import run_episode
from mpgrasp.exceptions import CameraError, ConfigError, SimulationError
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap
from mpgrasp.suite import Suite, episode_seed, load_suite, parse_suite

ROOT = Path(__file__).resolve().parent.parent
STILL = np.zeros(4)
DOWN = np.array([0.0, 0.0, -1.0, 0.0])

Make = Callable[..., GraspEnv]


class Painter:
    """Paints a spot of quality that stands still in the camera, on an image of any crop and size."""

    name = "painter"

    def __init__(self, crop: int = 350, size: int = 224, height: float = 1.0) -> None:
        self.crop, self.size, self.height = crop, size, height

    def reset(self, truth: HeightMap | None) -> None: ...

    def predict(self, frame: DepthFrame) -> GraspMap:
        image = crop_resize(frame, self.crop, self.size)
        k = image.intrinsics
        x, y = (np.arange(k.width) - k.cx) / k.fx, (np.arange(k.height) - k.cy)[:, None] / k.fy
        quality = self.height * np.exp(-((x - 0.1) ** 2 + (y + 0.05) ** 2) / 0.05).astype(np.float32)
        flat = np.zeros_like(quality)
        return GraspMap(
            quality=quality, angle=flat, width=flat + 20, depth=inpaint(image.depth), intrinsics=k,
            T_world_camera=image.T_world_camera, time=image.time,
        )  # fmt: skip


@pytest.fixture
def make() -> Iterator[Make]:
    made: list[GraspEnv] = []

    def make_env(detector: Any = "oracle", **settings: Any) -> GraspEnv:
        made.append(GraspEnv("thin", detector, EpisodeConfig(**settings)))
        return made[-1]

    yield make_env
    for env in made:
        env.close()


def test_a_suite_s_settings_are_those_of_the_environment() -> None:
    declared = {
        "title": "t",
        "sensor": {"subpixel": 0.12},
        "controller": {"z_min": 0.2},
        "detector": {"play": 0.002},
    }
    env = GraspEnv(parse_suite("mine", declared))
    assert env.config.sensor.subpixel == 0.12
    assert env.mppc.config == replace(MPPC, z_min=0.2)
    assert isinstance(env.detector, OracleDetector)
    assert env.detector.config == OracleConfig(play=0.002)
    with pytest.raises(ConfigError, match=r"controller\.threshold: no setting of mppc"):
        GraspEnv(parse_suite("mine", {"title": "t", "controller": {"threshold": 1}}))


def play(env: GraspEnv, action: np.ndarray | None = None, most: int = 300) -> tuple[Any, ...]:
    """Step with one action, or with MP-PC's, from seed 0 to the end; number of steps, then the last step."""
    _, info = env.reset(options={"episode": 0})
    for k in range(1, most + 1):
        step = env.step(info["mppc_action"] if action is None else action)
        assert step[0] in env.observation_space
        info = step[-1]
        if step[2]:
            return k, *step
    raise AssertionError(f"no end in {most} steps")


class Viewer:
    """Stands for MuJoCo's, and notes what it is asked for."""

    viewport = None

    def __init__(self, calls: list[str]) -> None:
        self._calls = calls

    def is_running(self) -> bool:
        return True

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *_: self._calls.append(name)


def test_gymnasium_has_nothing_to_complain_about(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mpgrasp.recording.window._launch", lambda model, data: Viewer([]))
    env = gymnasium.make("mpgrasp.env:mpgrasp/Grasp-v0", render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.close()


def test_with_the_actions_of_mppc_an_episode_ends_as_in_the_benchmark(make: Make) -> None:
    env = make(start_height=0.3)
    _, observed, reward, terminated, truncated, info = play(env)
    suite = load_suite("thin")
    expected = run_episode(
        suite.scene_config(0), episode_seed("thin", 0, 0), detector=make_detector("oracle"),
        controller=make_controller("mppc"), config=env.config,
    )  # fmt: skip
    result = info["result"]
    assert (terminated, truncated) == (True, False)
    assert (result.outcome, result.object, result.ticks) == (
        expected.outcome,
        expected.object,
        expected.ticks,
    )
    assert reward == float(expected.success) == float(info["is_success"])
    assert info["outcome"] == str(expected.outcome)
    # actions are single precision, so the ways differ by less than a micrometre
    assert result.path_length_m == pytest.approx(expected.path_length_m, abs=1e-6)
    assert expected.grasp is not None
    np.testing.assert_allclose(result.grasp.position, expected.grasp.position, atol=1e-5)
    assert observed["tcp"][2] <= env.mppc.config.z_min


def test_the_world_is_a_function_of_the_seed_and_not_of_what_was_done(make: Make) -> None:
    env, other = make("oracle"), make(Painter())
    first, info = env.reset(options={"episode": 3})
    assert info["scene_seed"] == episode_seed("thin", 0, 3)
    for _ in range(3):
        env.step(np.array([1.0, -1.0, -1.0, 1.0]))
    env.reset()
    again, _ = env.reset(options={"episode": 3})
    elsewhere, _ = other.reset(options={"episode": 3}, seed=1)
    for name in ("depth", "tcp", "yaw", "time"):
        np.testing.assert_array_equal(first[name], again[name])
        np.testing.assert_array_equal(first[name], elsewhere[name])
    assert not np.array_equal(first["depth"], env.reset(options={"episode": 4})[0]["depth"])


def test_resets_follow_np_random_and_stay_clear_of_the_benchmark(make: Make) -> None:
    seeds = []
    for env in (make(Painter()), make(Painter())):
        seeds.append([env.reset(seed=seed)[1]["scene_seed"] for seed in (7, None, None)])
    drawn = np.random.default_rng(7).integers(FIRST_TRAINING_EPISODE, 2**31, 3)
    assert seeds[0] == seeds[1] == [episode_seed("thin", 0, int(number)) for number in drawn]
    assert drawn.min() >= FIRST_TRAINING_EPISODE


def test_no_seed_of_training_begins_on_a_world_of_the_benchmark() -> None:
    """Worlds of the first reset, whatever the seed, and of many after it, against those of three runs."""
    played = {episode_seed("thin", run, k) for run in range(3) for k in range(5000)}
    first = [np.random.default_rng(seed).integers(FIRST_TRAINING_EPISODE, 2**31) for seed in range(2000)]
    later = np.random.default_rng(7).integers(FIRST_TRAINING_EPISODE, 2**31, 5000)
    assert played.isdisjoint(episode_seed("thin", 0, int(number)) for number in (*first, *later))


def test_many_environments_of_one_seed_begin_in_training(monkeypatch: pytest.MonkeyPatch) -> None:
    """`make_vec_env(seed=7)` of a learner gives its environments the seeds 7, 8, 9, ..."""
    numbers: list[int] = []

    def note(suite: Suite, number: int) -> Any:
        numbers.append(number)
        raise KeyboardInterrupt

    monkeypatch.setattr(Suite, "scene_config", note)
    for seed in range(7, 27):
        with pytest.raises(KeyboardInterrupt):
            GraspEnv(detector=Painter()).reset(seed=seed)
    assert min(numbers) >= FIRST_TRAINING_EPISODE
    assert len(set(numbers)) == 20


@pytest.mark.parametrize(
    "options",
    [
        {"episodes": 3},
        {"seed": 3},
        {"episode": -1},
        {"episode": 1.0},
        {"episode": True},
        {"episode": "3"},
        {"episode": None},
        {"episode": FIRST_TRAINING_EPISODE},
        {"episode": 3, "suite": "thin"},
    ],
    ids=str,
)
def test_options_that_reset_does_not_know_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"episode"):
        GraspEnv(detector=Painter()).reset(options=options)


def test_a_detector_by_name_is_checked_at_once_and_made_at_the_first_reset() -> None:
    for name, said in (("nonsense", "unknown detector"), ("fakes:NoSuchDetector", "NoSuchDetector")):
        with pytest.raises(ConfigError, match=said):
            GraspEnv(detector=name)
    env = GraspEnv(detector="fakes:FailsToStart")
    with pytest.raises(ConfigError, match="no licence"):
        env.reset()


def require_gl_here() -> None:
    try:
        require_gl()
    except CameraError as error:
        pytest.skip(str(error))


def in_a_thread(call: Callable[[], object]) -> object:
    """Return what a call gives in a thread of its own, or the error that it raises."""
    given: list[object] = []

    def run() -> None:
        try:
            given.append(call())
        except Exception as error:
            given.append(error)

    thread = threading.Thread(target=run, name="other")
    thread.start()
    thread.join(60)
    assert given, "it hangs"
    return given[0]


@pytest.mark.parametrize("backend", BACKENDS[1:])
def test_an_environment_belongs_to_its_thread_until_it_is_closed(make: Make, backend: str) -> None:
    if backend == "gl":
        require_gl_here()
    env = make(Painter(), camera_backend=backend)
    first = env.reset(options={"episode": 0})[0]
    for call in (lambda: env.step(STILL), lambda: env.reset(), env.close):
        refused = in_a_thread(call)
        assert isinstance(refused, ConfigError)
        assert "belongs to the thread" in str(refused)
        assert "MainThread, any other after close()" in str(refused)
    env.step(STILL)
    env.close()
    again = in_a_thread(lambda: env.reset(options={"episode": 0}))
    assert isinstance(again, tuple)
    np.testing.assert_array_equal(again[0]["depth"], first["depth"])
    # that thread has ended, so that nobody can go on with its episode
    np.testing.assert_array_equal(env.reset(options={"episode": 0})[0]["depth"], first["depth"])


def test_environments_in_threads_of_their_own_see_what_one_alone_sees() -> None:
    def play_a_little() -> list[np.ndarray]:
        env = GraspEnv(detector=Painter())
        seen = [env.reset(options={"episode": 2})[0]["depth"]]
        seen += [env.step(DOWN)[0]["depth"] for _ in range(3)]
        env.close()
        return seen

    alone = play_a_little()
    with ThreadPoolExecutor(3) as pool:
        for seen in [future.result(60) for future in [pool.submit(play_a_little) for _ in range(3)]]:
            np.testing.assert_array_equal(seen, alone)


def test_an_action_is_a_velocity_in_units_of_the_documented_scale(make: Make) -> None:
    env = make(Painter(), noise=False)
    action = np.array([0.8, -1.0, 0.5, 1.0])
    env.reset(options={"episode": 0})
    for _ in range(4):  # the ramp
        before = env.step(action)[0]
    for _ in range(3):
        after = env.step(action)[0]
    seconds = float(after["time"][0] - before["time"][0])
    assert seconds == pytest.approx(0.3)
    moved = np.append(after["tcp"] - before["tcp"], after["yaw"] - before["yaw"]) / seconds
    np.testing.assert_allclose(moved, action * ACTION_SCALE, atol=2e-3)


def test_actions_are_cut_at_the_box_and_refused_where_they_mean_nothing(make: Make) -> None:
    env = make(Painter())
    env.reset(options={"episode": 0})
    at_the_bound = env.step(DOWN)[0]
    env.reset(options={"episode": 0})
    np.testing.assert_array_equal(env.step(7 * DOWN)[0]["tcp"], at_the_bound["tcp"])
    for action in (np.full(4, np.nan), np.zeros(3)):
        with pytest.raises(ConfigError, match="4 finite numbers"):
            env.step(action)


def test_depth_is_that_of_the_table_and_zero_where_nothing_returned(make: Make) -> None:
    observed, _ = make(Painter(), start_height=0.45).reset(options={"episode": 0})
    depth = observed["depth"]
    assert (depth == 0).any()
    # the optical centre lies 63 mm above the tcp; cloth and stick are a few millimetres high
    assert float(np.median(depth[depth > 0])) == pytest.approx(float(observed["tcp"][2]) + 0.0634, abs=0.01)


def test_quality_lies_on_the_pixels_of_depth_whatever_the_detector_sees(make: Make) -> None:
    whole = make(Painter()).reset(options={"episode": 0})[0]["quality"]
    part = make(Painter(crop=200, size=300)).reset(options={"episode": 0})[0]["quality"]
    seen = np.abs(np.arange(224) - 111.5) < 200 / 350 * 112 - 1
    np.testing.assert_allclose(part[np.ix_(seen, seen)], whole[np.ix_(seen, seen)], atol=2e-3)
    beyond = np.abs(np.arange(224) - 111.5) > 200 / 350 * 112 + 1
    assert whole[beyond].max() > 0.1
    assert not part[beyond].any()
    assert not part[:, beyond].any()


def test_a_stretched_arm_ends_the_episode_with_a_reflex_that_has_a_name(make: Make) -> None:
    _, _, reward, terminated, truncated, info = play(make(Painter()), np.array([1.0, 0.0, 0.0, 0.0]))
    assert (reward, terminated, truncated) == (0.0, True, False)
    assert info["outcome"] == "reflex"
    assert info["reflex"].startswith(f"{info['result'].reflex.limit}: ")
    assert info["result"].grasp is None


def test_time_runs_out(make: Make) -> None:
    steps, observed, reward, terminated, truncated, info = play(make(Painter(), max_reach_time=0.3), STILL)
    assert (steps, reward, terminated, truncated) == (3, 0.0, True, False)
    assert observed["time"] == pytest.approx(0.3)
    assert (info["outcome"], info["reflex"], info["result"].ticks) == ("timeout", "", 3)


def test_who_sees_nothing_grasps_in_vain(make: Make) -> None:
    """Algorithm 1 always grasps: at the best of the pool, be it worth nothing."""
    _, _, reward, *_, info = play(make(Painter(height=0.0), start_height=0.2), DOWN)
    assert (reward, info["outcome"], info["is_success"]) == (0.0, "missed", False)


def test_stepping_needs_an_episode_that_runs(make: Make) -> None:
    env = make(Painter(), max_reach_time=0.1)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(STILL)
    play(env, STILL)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(STILL)
    env.close()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(STILL)


def test_what_the_simulator_warns_of_is_raised_and_takes_a_reset(make: Make) -> None:
    env = make(Painter())
    env.reset(seed=0)
    assert env._episode is not None
    env._episode.simulation.data.qpos[0] = np.nan
    with pytest.raises(SimulationError, match=r"BADQPOS.*panda/joint1"):
        env.step(STILL)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(STILL)
    env.reset(seed=0)
    assert not env.step(STILL)[2]


def test_unusable_settings_are_refused_by_name() -> None:
    with pytest.raises(ConfigError, match=r"above 0\.175"):
        GraspEnv(config=EpisodeConfig(start_height=0.15))
    with pytest.raises(ConfigError, match="rgb_array"):
        GraspEnv(render_mode="ansi")
    with pytest.raises(
        ConfigError, match="unknown kind of observations; got 'pixels'; allowed: arrays, images"
    ):
        GraspEnv(observations="pixels")
    with pytest.raises(ConfigError, match="unknown suite"):
        GraspEnv("nonsense")


def test_several_run_side_by_side_and_none_resets_itself() -> None:
    # the first is all but down when it starts
    envs = [
        GraspEnv(detector=Painter(height=0.0), config=EpisodeConfig(start_height=z)) for z in (0.176, 0.5)
    ]
    vector = SyncVectorEnv([lambda env=env: env for env in envs])  # type: ignore[misc]
    vector.reset(seed=5)
    *_, terminated, _, info = vector.step(np.tile(DOWN, (2, 1)))
    assert terminated.tolist() == [True, False]
    assert info["outcome"].tolist() == ["missed", None]
    assert info["mppc_action"].shape == (2, 4)
    assert GraspEnv.metadata["autoreset_mode"] is AutoresetMode.DISABLED
    vector.close()


@pytest.mark.parametrize("name", [name for name, suite in SUITES.items() if suite])
def test_an_environment_by_name_is_that_of_its_suite(name: str) -> None:
    env = gymnasium.make(f"{NAMESPACE}/{name}")
    assert isinstance(env.unwrapped, GraspEnv)
    assert env.unwrapped.suite.name == SUITES[name]
    env.close()


@pytest.mark.parametrize("order", ["gymnasium, mpgrasp.env_ids", "mpgrasp.env_ids, gymnasium"])
def test_importing_the_names_tells_gymnasium_its_environments_and_loads_no_world(order: str) -> None:
    code = (
        f"import sys, {order}\n"
        "print([e for e in gymnasium.registry if 'mpgrasp' in e], {'mujoco', 'torch'} & set(sys.modules))\n"
        "gymnasium.make('mpgrasp/Search-v0', detector='oracle')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    names = [f"{NAMESPACE}/{name}" for name in SUITES]
    assert done.stdout.strip() == f"{names} set()", done.stderr
    assert done.returncode == 0, done.stderr


def test_a_gymnasium_that_loads_plug_ins_by_itself_registers_each_once() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    assert declared["gymnasium.envs"] == {NAMESPACE: "mpgrasp.env_ids:register"}
    code = (
        "import gymnasium; from gymnasium.envs.registration import namespace\n"
        f"with namespace({NAMESPACE!r}):\n    from mpgrasp.env_ids import register; register(); register()\n"
        "print([e for e in gymnasium.registry if 'mpgrasp' in e])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == str([f"{NAMESPACE}/{name}" for name in SUITES]), done.stderr


def test_people_see_every_tick_in_a_window_that_closes_with_the_episode(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls: list[str] = []
    monkeypatch.setattr("mpgrasp.recording.window._launch", lambda model, data: Viewer(calls))
    config = EpisodeConfig(camera_backend="ray", max_reach_time=0.3)
    env = GraspEnv(detector=Painter(), render_mode="human", config=config)
    env.reset(options={"episode": 0})
    over = False
    while not over:
        _, _, over, _, _ = env.step(STILL)
        assert env.render() is None
    assert calls.count("sync") == 3
    assert calls[-1] == "close"
    env.reset(options={"episode": 0})
    env.close()
    assert calls.count("close") == 2


def test_the_depth_that_is_rendered_is_the_depth_that_is_observed() -> None:
    env = GraspEnv(detector=Painter(), render_mode="depth_array", config=EpisodeConfig(camera_backend="ray"))
    observed, _ = env.reset(seed=0)
    picture = env.render()
    assert picture is not None
    assert np.array_equal(picture, observed["depth"])
    env.close()
