"""The world of an episode: the settled scene, the arm at its start and the camera on its wrist."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.camera.fixed_pattern import FixedPattern
from mpgrasp.camera.patches import Patches
from mpgrasp.camera.standing_errors import StandingErrors, calibration_error
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.seeds import calibration_rng, patches_rng, pattern_rng, start_rng
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, invert, looking_down
from mpgrasp.linear_algebra import product
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.ik import DifferentialIK, solve_pose
from mpgrasp.motion.reflex import ReflexMonitor
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import build_scene
from mpgrasp.scene.simulation import Simulation
from mpgrasp.workspace import WORKSPACE_CENTRE

_DRAWS = 20  # of a start that can be reached; a region of which next to nothing can is a slip


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
        self.camera.errors = self._standing_errors(scene_config, seed)
        self._put_at_start(start_rng(seed))
        self.driver = ArmDriver(
            self.simulation,
            config.motion,
            DifferentialIK(config.ik),
            ReflexMonitor(config.reflex),
        )

    def _standing_errors(self, scene: SceneConfig, seed: int) -> StandingErrors:
        """Draw the errors of the camera that stand for the episode."""
        camera, sensor, image = self._config.camera, self._config.sensor, self.camera.image
        pattern = patches = None
        if self._config.noise and sensor.fixed_pattern > 0:
            shape, scale = (image.height, image.width), image.fx / sensor.focal_px
            pattern = FixedPattern(sensor, shape, scale, pattern_rng(seed))
        if scene.no_return > 0:
            share, size = scene.no_return, scene.no_return_size
            patches = Patches(self.scene.model, self.scene.objects, share, size, patches_rng(seed))
        return StandingErrors(
            calibration=calibration_error(
                camera.calibration_translation, camera.calibration_rotation, calibration_rng(seed)
            ),
            pattern=pattern,
            patches=patches,
        )

    def _put_at_start(self, rng: np.random.Generator) -> None:
        """Set the arm to its first viewpoint; one that it does not reach is drawn again."""
        config = self._config
        for draw in range(_DRAWS):
            try:
                start = np.array(WORKSPACE_CENTRE) + _start_offset(config, rng)
                return self.put_camera_above(start, config.start_height)
            except ConfigError:
                if draw == _DRAWS - 1:
                    raise

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


def _start_offset(config: EpisodeConfig, rng: np.random.Generator) -> FloatArray:
    """Draw the first viewpoint's offset (2,) from the workspace's centre [m]."""
    if config.start_radius is None:
        return np.asarray(np.clip(rng.standard_normal(2), -2, 2) * config.start_jitter)
    radius, angle = config.start_radius * np.sqrt(rng.uniform()), rng.uniform(-np.pi, np.pi)
    return np.asarray(radius * np.array([np.cos(angle), np.sin(angle)]))
