"""The reach as a gymnasium environment: a policy steers the wrist camera, MP-PC's rule picks the grasp.

Importing this module, or `mpgrasp.env_ids` alone, tells gymnasium the environments: then there is
`gymnasium.make("mpgrasp/Thin-v0")`, and those of other suites.
World, noise, arm and verdict are those of `mpgrasp.episode`: with MP-PC's own actions an episode ends as
in the benchmark. Reference: https://gymnasium.farama.org/api/env/
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

import mpgrasp.env_ids  # noqa: F401  # registers the environments
from mpgrasp.controllers.config import ReachConfig
from mpgrasp.controllers.controller import Command
from mpgrasp.controllers.mppc import Mppc
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.env_spaces import OBSERVATIONS, space_of
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import Episode
from mpgrasp.episode.seeds import controller_seed
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.settings import refuse_unknown
from mpgrasp.grasp import Grasp
from mpgrasp.plugin_names import canonical
from mpgrasp.plugins import check_name, detector_names, load_detector
from mpgrasp.recording.policy_view import ACTION_SCALE as ACTION_SCALE
from mpgrasp.recording.policy_view import (
    Observed,
    Pictured,
    action_of,
    observed,
    observed_depth,
    pictured,
    twist_of,
)
from mpgrasp.recording.watcher import Watcher
from mpgrasp.recording.window import Window
from mpgrasp.settings.sharing import controller_settings, detector_settings
from mpgrasp.suite import Suite, episode_seed, load_suite

FIRST_TRAINING_EPISODE = 2**20
"""Episodes of this number and above are drawn for training; below lie those of the benchmark."""

Info = dict[str, Any]
Seen = Observed | Pictured
"""Observation of either kind."""


class GraspEnv(gymnasium.Env[Seen, NDArray[np.float32]]):
    """One grasp attempt per episode, one control tick (0.1 s) per step.

    Action, (4,) in [-1, 1]: velocity of the tool point along world x, y, z and yaw rate, in units of
    `ACTION_SCALE`; what exceeds the box is cut. No action grasps: when the tool has come down to z_min, the
    best grasp of the pool B (Algorithm 1, line 17) is executed and judged within that last step.

    Observation, float32: `depth` (224, 224) [m], the camera's central square, 0 where there was no return;
    `quality` (224, 224), the detector's Q on the same pixels; `tcp` (3,) world position [m]; `yaw` (1,) of
    the tcp's x axis [rad]; `time` (1,) since the start [s]. The last is the view before the grasp.
    With `observations="images"`, as learners with convolutions take them: `image` (2, 84, 84) of bytes and
    `state` (6,), see `mpgrasp.recording.policy_view.Pictured`.

    Reward: 1 for an object lifted, held and shaken, else 0. Every episode ends as terminated: a protective
    stop or `max_reach_time`, which the policy sees coming in `time`, is a failure like any other.

    Info: `scene_seed`; `mppc_action` (4,), what MP-PC would do now, to imitate or to compare with; after the
    last step also `outcome`, `is_success`, `reflex` in words or "", and `result`, the `EpisodeResult`.

    `reset()` draws an episode from `np_random`, which `reset(seed=...)` seeds, never one of the benchmark.
    `reset(options={"episode": k})` sets up episode k of the suite as the benchmark plays it with seed 0,
    whatever happened before.

    An environment belongs to the thread that resets it first; several, each in a thread of its own, may run
    at once. `AsyncVectorEnv` may fork its processes unless this one has used OpenGL, OpenVINO or torch, which
    hang in forks: then the first reset says so, and `context="spawn"` works always.

    Args:
        suite: name, path or declaration of what is on the table.
        detector: registry name, `module:Class`, or a detector; grasps and `quality` are its. By name, it is
            made at the first reset, so that it can run in the process that does that.
        config: how an episode runs; the suite's settings by default.
        controller: settings of z_min, the pool and `mppc_action`; MP-PC's with the suite's by default.
        render_mode: None, "rgb_array" (a view of the whole scene), "depth_array" (`depth` as seen last) or
            "human" (MuJoCo's viewer, at the pace of the episode's time; closing it interrupts).
        observations: one of `OBSERVATIONS`.

    Raises:
        ConfigError: a suite, name or setting that cannot be used.
    """

    metadata = {  # noqa: RUF012
        "render_modes": ["rgb_array", "depth_array", "human"], "render_fps": 10,
        "autoreset_mode": AutoresetMode.DISABLED,
    }  # fmt: skip

    def __init__(
        self,
        suite: str | Suite = "thin",
        detector: str | GraspDetector = "oracle",
        config: EpisodeConfig | None = None,
        controller: ReachConfig | None = None,
        render_mode: str | None = None,
        observations: str = "arrays",
    ) -> None:
        if observations not in OBSERVATIONS:
            raise ConfigError("unknown kind of observations", got=observations, allowed=OBSERVATIONS)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ConfigError("unknown render mode", got=render_mode, allowed=self.metadata["render_modes"])
        self.metadata = dict(self.metadata)  # vector environments write into it
        self.render_mode = render_mode
        self.suite = load_suite(suite) if isinstance(suite, str) else suite
        if isinstance(detector, str):
            self._make_detector = _named(detector, self.suite)
        else:
            self.detector = detector
        self.config = config or self.suite.episode_config()
        self.mppc = Mppc(controller or _mppc_config(self.suite))
        start, z_min = self.config.start_height, self.mppc.config.z_min
        if start <= z_min:
            raise ConfigError("the reach would end where it begins", got=start, allowed=f"above {z_min} m")
        self.observations = observations
        self.action_space = spaces.Box(-1.0, 1.0, (len(ACTION_SCALE),), np.float32)
        longest = self.config.max_reach_time + 2 * self.config.control_dt
        self.observation_space = space_of(observations, longest)  # type: ignore[assignment]
        self._episode: Episode | None = None
        self._watcher: Watcher | None = None
        self._window: Window | None = None
        self._thread: threading.Thread | None = None

    @functools.cached_property
    def detector(self) -> GraspDetector:
        """Detector whose grasps these are.

        Raises:
            ConfigError, WeightsError: it cannot be made, or not in a forked process.
        """
        return self._make_detector()

    def reset(self, *, seed: int | None = None, options: Info | None = None) -> tuple[Seen, Info]:
        """Set up an episode: one drawn for training, or with the option `episode` that of the benchmark.

        Raises:
            ConfigError: other options, a detector that cannot be used, another thread's episode, or
                a process that was forked after OpenGL, OpenVINO or torch had started.
            WeightsError: weights of the detector that cannot be used.
        """
        told = _episode_told(options)
        self.close()
        self._thread = threading.current_thread()
        super().reset(seed=seed)
        number = told
        if number is None:
            number = int(self.np_random.integers(FIRST_TRAINING_EPISODE, 2**31))
        scene, scene_seed = self.suite.scene_config(number), episode_seed(self.suite.name, 0, number)
        self._window = Window(lingers=False) if self.render_mode == "human" else None
        self._episode = Episode(
            scene, scene_seed, detector=self.detector, config=self.config, recorder=self._window
        )
        self._over = False
        self._begin(self._episode)
        return self._look(self._episode)

    def step(self, action: ArrayLike) -> tuple[Seen, float, bool, bool, Info]:
        """Move for one control tick, look, and at z_min grasp.

        Raises:
            ConfigError: an action that is not four finite numbers, or another thread than that of `reset`.
            gymnasium.error.ResetNeeded: there is no episode, or it is over.
            PlugInError: what the detector returned cannot be used.
            SimulationError: MuJoCo has warned.
        """
        self._check_thread()
        episode = self._episode
        if episode is None or self._over:
            raise gymnasium.error.ResetNeeded("there is no episode, or it is over: call reset() first")
        command = Command(twist=twist_of(action), gripper=self.mppc.config.gripper_open)
        self._over = True  # unless the step goes well
        episode.act(command, {})
        observed, info = self._look(episode)
        interrupted = episode.interruption() is not None
        self._over = interrupted or self._command.done
        if not self._over:
            return observed, 0.0, False, False, info
        if not interrupted:
            episode.act(self._command, {})
        return self._end(episode, None if interrupted else self.mppc.final_grasp(), observed, info)

    def render(self) -> NDArray[Any] | None:
        """Return a picture (312, 352, 3) of the scene as it is now, or the last depth, as the mode says."""
        if self.render_mode in (None, "human"):  # the window shows itself
            return None
        self._check_thread()
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("there is nothing to see: call reset() first")
        if self.render_mode == "depth_array":
            return None if self._episode.frame is None else observed_depth(self._episode.frame)[1]
        self._watcher = self._watcher or Watcher(self._episode.scene.model, self.config.camera_backend)
        return self._watcher.picture(self._episode.simulation.data)

    def close(self) -> None:
        """Free cameras and the episode, and the environment for another thread.

        Raises:
            ConfigError: the episode belongs to another thread, which runs.
        """
        self._check_thread()
        self._thread = None
        for item in (self._episode, self._watcher, self._window):
            if item is not None:
                item.close()
        self._episode = self._watcher = self._window = None

    def _begin(self, episode: Episode) -> None:
        """Start what a fresh episode is for."""
        self.mppc.reset(controller_seed(episode.seed))

    def _end(
        self, episode: Episode, grasp: Grasp | None, observed: Seen, info: Info
    ) -> tuple[Seen, float, bool, bool, Info]:
        """Execute the grasp of a reach, and return what its last step gives."""
        result = episode.conclude(grasp)
        info |= {"outcome": result.outcome.value, "is_success": result.success, "result": result}
        info["reflex"] = str(result.reflex or "")
        return observed, float(result.success), True, False, info

    def _check_thread(self) -> None:
        """Raise ConfigError if another thread has an episode here and may go on with it."""
        owner = self._thread
        if owner is not None and owner is not threading.current_thread() and owner.is_alive():
            raise ConfigError(
                "an environment belongs to the thread that has reset it",
                got=threading.current_thread().name,
                allowed=f"{owner.name}, any other after close() there, or one environment for each thread",
            )

    def _look(self, episode: Episode) -> tuple[Seen, Info]:
        view = episode.look()
        with episode.timed("control"):
            self._command = self.mppc.update(view)
        assert episode.frame is not None
        at = view.T_world_tcp, view.time
        images = self.observations == "images"
        seen: Seen = pictured(view.grasp_map, *at) if images else observed(episode.frame, view.grasp_map, *at)
        return seen, {"scene_seed": episode.seed, "mppc_action": action_of(self._command.twist)}


def _named(name: str, suite: Suite) -> Callable[[], GraspDetector]:
    """Return what makes the detector of that name, with the settings that the suite has for it."""
    name = canonical("detector", name)
    check_name("detector", name, detector_names())
    settings = detector_settings((name,), suite.detector)[name]
    return functools.partial(load_detector, name, settings=settings)


def _episode_told(options: Info | None) -> int | None:
    """Return the number of the benchmark's episode that options of `reset` ask for, None without one."""
    if not options:
        return None
    refuse_unknown(options, ("episode",), "options of reset")
    number = options["episode"]
    whole = isinstance(number, int | np.integer) and not isinstance(number, bool)
    if not (whole and 0 <= number < FIRST_TRAINING_EPISODE):
        raise ConfigError(
            "no episode of the benchmark", got=number, allowed=f"0 to {FIRST_TRAINING_EPISODE - 1}"
        )
    return int(number)


def _mppc_config(suite: Suite) -> ReachConfig:
    """Return the settings of MP-PC, with those that the suite has for it."""
    config = controller_settings(("mppc",), suite.controller)["mppc"]
    assert isinstance(config, ReachConfig)
    return config
