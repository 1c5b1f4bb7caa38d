"""The card of a run's world tells what the episodes really are made of."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco

from mpgrasp.bench.playing.world_card import physics_card, world_card
from mpgrasp.bench.results.run_card import WorldCard
from mpgrasp.camera.config import D435_INTRINSICS, CameraConfig
from mpgrasp.camera.noise import DepthNoise
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.motion.ik_config import IkConfig
from mpgrasp.motion.reflex import ReflexConfig
from mpgrasp.motion.trajectory import MotionConfig
from mpgrasp.suite import load_suite

SUITE = load_suite("thin")


def card(**changes: Any) -> WorldCard:
    config = replace(SUITE.episode_config(camera="ray"), **changes)
    assert isinstance(config, EpisodeConfig)
    return world_card(SUITE, config, 0)


def test_the_card_says_with_which_settings_the_episode_builds_its_arm_and_its_camera() -> None:
    found = card(
        motion=MotionConfig(max_speed=0.123),
        ik=IkConfig(damping=0.0123),
        reflex=ReflexConfig(contact_force=12.3),
        sensor=DepthNoise(subpixel=0.123),
    )
    assert found.motion["max_speed"] == 0.123
    assert found.ik["damping"] == 0.0123
    assert found.reflex["contact_force"] == 12.3
    assert found.camera["noise"]["subpixel"] == 0.123


def test_the_camera_of_the_card_is_the_whole_sensor_whatever_the_crop() -> None:
    found = card(noise=False, camera=CameraConfig(crop=300, intrinsics=replace(D435_INTRINSICS, width=600)))
    assert found.camera["backend"] == "ray"
    assert found.camera["noise"] is None
    assert (found.camera["intrinsics"]["width"], found.camera["intrinsics"]["height"]) == (600, 480)


def test_physics_are_those_of_the_compiled_model() -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><option timestep='0.004' cone='elliptic' impratio='7'/><worldbody>"
        "<geom name='table' type='plane' size='1 1 .1' friction='0.3 0.02 0.001' condim='4'/>"
        "<geom type='sphere' size='.1'/>"
        "<geom name='ghost' type='sphere' size='.1' contype='0' conaffinity='0'/></worldbody></mujoco>"
    )
    found = physics_card(model)
    assert (found["timestep"], found["cone"], found["impratio"]) == (0.004, "mjCONE_ELLIPTIC", 7.0)
    assert list(found["geoms"]) == ["table"]
    assert found["geoms"]["table"]["friction"] == [0.3, 0.02, 0.001]
    assert found["geoms"]["table"]["condim"] == 4
