"""Laws of the world that an episode plays in."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mpgrasp.camera.noise import DepthNoise
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.world import World
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.config import SceneConfig

SCENE = SceneConfig(objects=("usb_stick",))


def test_the_camera_stands_above_the_place_that_it_is_put_above() -> None:
    world = World(SCENE, 0, EpisodeConfig(camera_backend="ray"))
    world.put_camera_above((0.45, 0.05), 0.3)
    T = world.camera.pose(world.simulation.data)
    np.testing.assert_allclose(T[:2, 3], (0.45, 0.05), atol=1e-4)
    np.testing.assert_allclose(T[:3, 2], (0, 0, -1), atol=1e-4)
    assert world.simulation.T_world_tcp[2, 3] == pytest.approx(0.3, abs=1e-4)
    with pytest.raises(ConfigError, match="out of reach"):
        world.put_camera_above((3.0, 0.0), 0.3)
    world.close()


@pytest.mark.parametrize("noise", [True, False])
def test_the_configs_told_are_those_in_use(noise: bool) -> None:
    world = World(SCENE, 0, EpisodeConfig(camera_backend="ray", noise=noise))
    world.driver.monitor.config = dataclasses.replace(world.driver.monitor.config, cartesian_velocity=0.5)
    told = world.configs()
    assert told["camera"]["backend"] == "ray"
    assert told["camera"]["noise"] == (DepthNoise() if noise else None)
    assert (told["camera"]["intrinsics"].width, told["camera"]["intrinsics"].height) == (640, 480)
    assert told["motion"].dt == world.driver.steps_per_tick * world.scene.model.opt.timestep
    assert told["reflex"] is world.driver.monitor.config
    assert told["ik"] is world.driver.ik.config
    world.close()
