"""The world of an episode: the settled scene, the arm at its start and the camera on its wrist."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.seeds import start_rng
from mpgrasp.geometry import invert, looking_down
from mpgrasp.linear_algebra import product
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.ik import DifferentialIK, solve_pose
from mpgrasp.motion.reflex import ReflexMonitor
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import build_scene
from mpgrasp.scene.simulation import Simulation
from mpgrasp.workspace import WORKSPACE_CENTRE


class World:
    """All that an episode plays in. It depends on the seed alone, whatever detector and controller play.

    Args:
        scene_config: what is on the table.
        seed: of the scene and of the start pose.
        config: how the episode runs.
        colour: the camera's frames carry `rgb` too.

    Raises:
        ConfigError: a scene that cannot be built.
        CameraError: a camera backend that this machine does not have, or that has no colour.
    """

    def __init__(
        self, scene_config: SceneConfig, seed: int, config: EpisodeConfig, *, colour: bool = False
    ) -> None:
        self._config = config
        self.scene = build_scene(scene_config, seed)
        self.simulation = Simulation(self.scene)
        self.camera = WristCamera(
            self.scene.model,
            config.camera_backend,
            config.sensor if config.noise else None,
            intrinsics=config.camera.intrinsics,
            crop=config.camera.crop,
            colour=colour,
        )
        jitter = np.clip(start_rng(seed).standard_normal(2), -2, 2) * config.start_jitter
        self.put_camera_above(np.array(WORKSPACE_CENTRE) + jitter, config.start_height)
        self.driver = ArmDriver(
            self.simulation,
            config.motion,
            DifferentialIK(config.ik),
            ReflexMonitor(config.reflex),
        )

    def put_camera_above(self, position: ArrayLike, height: float) -> None:
        """Set the arm so that the camera looks straight down on a place; a driver is to be reset then.

        Args:
            position: world x, y below the camera [m].
            height: height of the tool point over the table [m].

        Raises:
            ConfigError: a place out of the arm's reach.
        """
        simulation = self.simulation
        T_tcp_camera = product(invert(simulation.T_world_tcp), self.camera.pose(simulation.data))
        T = looking_down([*np.asarray(position, float), height])
        T[:2, 3] -= product(T[:3, :3], T_tcp_camera[:3, 3])[:2]
        simulation.set_q(solve_pose(simulation.q, T))

    def configs(self) -> dict[str, Any]:
        """Return the configs in use, with the keys `camera`, `motion`, `ik` and `reflex`.

        `camera` has the `backend` in use, the `intrinsics` of the whole image, whatever the crop, and
        `noise`, None without any.
        """
        return {
            "camera": {
                "backend": self.camera.backend,
                "intrinsics": self._config.camera.intrinsics,
                "noise": self.camera.noise,
            },
            "motion": self.driver.config,
            "ik": self.driver.ik.config,
            "reflex": self.driver.monitor.config,
        }

    def close(self) -> None:
        """Free the camera."""
        self.camera.close()
