"""Learned policies as controllers: `--controller sb3:policy.zip` plays one of stable-baselines3.

A policy steers, as it does in `mpgrasp.env` with `observations="images"`; when the tool has come down to
z_min the best grasp of the pool B is executed, there and here (Algorithm 1, line 17). Its observations are
made of the detector's map, so that it takes any detector whose map is the camera's central square.

Reference: https://stable-baselines3.readthedocs.io
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mpgrasp.controllers.config import MPPC
from mpgrasp.controllers.controller import Command, Observation
from mpgrasp.controllers.mppc import Mppc
from mpgrasp.exceptions import ConfigError
from mpgrasp.extras import check_installed
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp
from mpgrasp.plugin_names import SB3
from mpgrasp.recording.policy_view import ACTION_SCALE, IMAGE, pictured, twist_of

_ALGORITHMS = {"common": "PPO", "sac": "SAC", "td3": "TD3"}
"""Algorithm that reads the policies of a module of stable_baselines3; A2C has PPO's policies."""


class Sb3Policy:
    """A policy that stable-baselines3 has saved, as a controller.

    To read one runs code that the file brings, as always with stable-baselines3: only take files that you
    trust.

    Args:
        file: what `model.save(file)` wrote, of PPO, A2C, SAC, TD3 or DDPG in an environment of mpgrasp with
            `observations="images"`.
        z_min: height of the tool at which the reach ends [m].

    Raises:
        ConfigError: no such file, none of those, or stable-baselines3 is not installed.
    """

    def __init__(self, file: str, z_min: float = MPPC.z_min) -> None:
        path = Path(file)
        if not path.is_file():
            raise ConfigError("no such file of a policy", got=file, allowed="a zip of stable-baselines3")
        self.name = f"sb3 {path.stem}"
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        self.config = {"policy": path.name, "sha256": digest, "z_min": z_min}
        self._mppc = Mppc(replace(MPPC, z_min=z_min))
        self._model = _load(path)

    def reset(self, seed: int) -> None:
        self._mppc.reset(seed)

    def remember_failure(self, position: FloatArray) -> None:
        """Lower quality around a failed grasp at world (3,) [m]."""
        self._mppc.remember_failure(position)

    def update(self, observation: Observation) -> Command:
        command = self._mppc.update(observation)
        if command.done:
            return command
        seen = pictured(observation.grasp_map, observation.T_world_tcp, observation.time)
        action, _ = self._model.predict(seen, deterministic=True)
        return Command(twist=twist_of(np.asarray(action)), gripper=MPPC.gripper_open)

    def final_grasp(self) -> Grasp | None:
        return self._mppc.final_grasp()

    def diagnostics(self) -> Mapping[str, FloatArray | float | bool]:
        return self._mppc.diagnostics()


def policy_factory(name: str) -> Callable[..., Sb3Policy]:
    """Return what makes the controller of a name such as "sb3:policy.zip", with settings by keyword."""

    def policy(z_min: float = MPPC.z_min) -> Sb3Policy:
        return Sb3Policy(name.removeprefix(SB3), z_min)

    return policy


def _load(path: Path) -> Any:
    check_installed("stable_baselines3", f"{SB3}{path}")
    import stable_baselines3

    algorithm = _algorithm(path)
    try:
        model = getattr(stable_baselines3, algorithm).load(path, device="cpu")
    except Exception as error:  # what a file brings may fail in any way
        raise ConfigError(
            f"a policy cannot be read ({type(error).__name__}: {error})",
            got=str(path),
            allowed=f"a zip of {algorithm}",
        ) from error
    shapes = {name: space.shape for name, space in getattr(model.observation_space, "items", dict)()}
    if shapes != {"image": (2, IMAGE, IMAGE), "state": (6,)} or model.action_space.shape != (
        len(ACTION_SCALE),
    ):
        raise ConfigError(
            "a policy of another environment",
            got=f"{path}: observations {shapes}, actions {model.action_space.shape}",
            allowed='one of mpgrasp with observations="images"',
        )
    return model


def _algorithm(path: Path) -> str:
    """Return the name of the class of stable_baselines3 that reads the file; runs nothing of it."""
    try:
        with zipfile.ZipFile(path) as archive:
            told = json.loads(archive.read("data"))
        module = str(told["policy_class"]["__module__"])
    except (OSError, zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise ConfigError(
            "no policy of stable-baselines3", got=str(path), allowed="what model.save(file) wrote"
        ) from error
    words = module.split(".")
    if words[0] != "stable_baselines3" or len(words) < 2 or words[1] not in _ALGORITHMS:
        raise ConfigError(
            "a policy that cannot steer here",
            got=f"{path}: {module}",
            allowed="a shipped policy class of PPO, A2C, SAC, TD3 or DDPG",
        )
    return _ALGORITHMS[words[1]]
