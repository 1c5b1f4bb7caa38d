"""Laws of the world that an episode plays in."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import kstest

from mpgrasp.camera.config import CameraConfig
from mpgrasp.camera.noise import DepthNoise
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.seeds import start_rng
from mpgrasp.episode.world import World, _start_offset
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.config import SceneConfig
from mpgrasp.workspace import WORKSPACE_CENTRE

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


def test_a_start_in_a_disc_is_uniform_in_it() -> None:
    places = []
    for seed in range(40):
        config = EpisodeConfig(camera_backend="ray", start_radius=0.12)
        offset = _start_offset(config, np.random.default_rng(seed))
        places.append(offset)
    radii = np.linalg.norm(places, axis=1)
    assert radii.max() <= 0.12
    # of a uniform disc, the square of the radius is uniform
    assert kstest((radii / 0.12) ** 2, "uniform").pvalue > 0.01
    assert EpisodeConfig().start_radius is None
    with pytest.raises(ConfigError, match="start_radius"):
        EpisodeConfig(start_radius=-0.1)


def test_a_start_that_the_arm_does_not_reach_is_drawn_again() -> None:
    config = EpisodeConfig(camera_backend="ray", start_radius=0.5)
    redrawn = 0
    for seed in range(12):
        world = World(SCENE, seed, config)
        rng = start_rng(seed)
        draws = [np.array(WORKSPACE_CENTRE) + _start_offset(config, rng) for _ in range(20)]
        seen = world.camera.pose(world.simulation.data)[:2, 3]
        world.close()
        (taken,) = (k for k, draw in enumerate(draws) if np.allclose(draw, seen, atol=1e-4))
        redrawn += taken > 0
        for draw in draws[:taken]:
            with pytest.raises(ConfigError, match="out of reach"):
                world.put_camera_above(draw, config.start_height)
    assert 0 < redrawn < 12


def test_a_start_of_which_nothing_can_be_reached_is_refused() -> None:
    with pytest.raises(ConfigError, match="out of reach"):
        World(SCENE, 0, EpisodeConfig(camera_backend="ray", start_height=1.0))


def test_errors_of_the_camera_are_drawn_from_the_seed_and_each_by_itself() -> None:
    camera = CameraConfig(calibration_translation=0.01)
    plain = EpisodeConfig(camera_backend="ray", camera=camera)
    noisy = dataclasses.replace(plain, sensor=DepthNoise(fixed_pattern=0.05))
    dark = dataclasses.replace(SCENE, no_return=0.5)
    worlds = [World(SCENE, 5, plain), World(SCENE, 5, noisy), World(dark, 5, noisy), World(SCENE, 6, plain)]
    first, *others = (world.camera.errors.calibration for world in worlds)
    assert first is not None
    same = [other is not None and np.array_equal(first, other) for other in others]
    assert same == [True, True, False]
    assert worlds[0].camera.errors.pattern is None
    assert worlds[1].camera.errors.pattern is not None
    assert worlds[1].camera.errors.patches is None
    assert worlds[2].camera.errors.patches is not None
    for world in worlds:
        world.close()
