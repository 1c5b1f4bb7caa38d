"""A stack stands as declared, every trial nearly alike; what rests sleeps, and wakes when it is touched."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.settling import STACK_SHIFT
from mpgrasp.scene.simulation import Simulation
from mpgrasp.suite import load_suite

PLANK = ObjectModel(name="plank", parts=(Part(shape="box", size=(0.05, 0.02, 0.01)),), mass=0.05)
TOWER = SceneConfig(
    objects=(PLANK, PLANK, PLANK),
    placing="stack",
    pattern=((0.0, 0.0, 0.0), (0.0, 0.0, 1.5), (0.0, 0.0, 0.0)),
    cloth_unevenness=0.0,
)
SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)


@cache
def stacked(seed: int) -> Scene:
    return build_scene(load_suite("stacked").scene, seed)


def poses(scene: Scene, data: mujoco.MjData) -> FloatArray:
    return np.array([data.body(name).xpos for name in scene.objects])


def test_the_declared_stack_is_the_same_structure_for_every_seed() -> None:
    scenes = [stacked(seed) for seed in range(3)]
    assert 8 <= len(scenes[0].objects) <= 10
    places = np.array([poses(scene, scene.data()) for scene in scenes])
    pattern = np.array(scenes[0].config.pattern)[:, :2] + scenes[0].config.centre
    assert np.abs(places[:, :, :2] - pattern).max() < STACK_SHIFT + scenes[0].config.jitter[0]
    # the layers are the same, the poses are not
    assert np.ptp(places[:, :, 2], axis=0).max() < 0.003
    assert np.ptp(places[:, :, 0], axis=0).min() > 0
    assert places[0, :, 2].max() > 0.08


def test_a_stack_is_a_function_of_config_and_seed() -> None:
    again = build_scene(load_suite("stacked").scene, 0)
    assert again.state.tobytes() == stacked(0).state.tobytes()


def test_the_declared_stack_stands_without_sleep() -> None:
    scene = build_scene(load_suite("stacked").scene, 1, robot=False)
    assert not scene.model.opt.enableflags & SLEEP
    data = scene.data()
    before = poses(scene, data)
    mujoco.mj_step(scene.model, data, 500)
    assert np.linalg.norm(poses(scene, data) - before, axis=1).max() < 0.001


def test_objects_of_a_stack_lie_on_each_other() -> None:
    scene = build_scene(TOWER, 0, robot=False)
    heights = poses(scene, scene.data())[:, 2]
    np.testing.assert_allclose(heights, [0.01, 0.03, 0.05], atol=5e-4)


def test_without_jitter_a_stack_stands_where_it_was_declared() -> None:
    scene = build_scene(replace(TOWER, jitter=(0.0, 0.0)), 0, robot=False)
    data = scene.data()
    np.testing.assert_allclose(poses(scene, data)[:, :2], [[0.5, 0.0]] * 3, atol=1e-3)
    heading = data.body(scene.objects[1]).xmat.reshape(3, 3)
    assert np.arctan2(heading[1, 0], heading[0, 0]) == pytest.approx(1.5, abs=0.01)


def test_a_stack_that_cannot_stand_is_refused_by_name() -> None:
    # the upper plank is held by its end
    leaning = replace(TOWER, objects=(PLANK, PLANK), pattern=((0.0, 0.0, 0.0), (0.09, 0.0, 0.0)))
    with pytest.raises(ConfigError, match=r"does not stand.*plank_2"):
        build_scene(leaning, 0, robot=False)


@pytest.mark.parametrize(
    "settings",
    [
        {"pattern": ((0.0, 0.0, 0.0),)},
        {"pattern": ()},
        {"pattern": ((0.0, 0.0),) * 3},
        {"pattern": ((0.0, 0.0, float("nan")),) * 3},
        {"jitter": (-0.001, 0.0)},
        {"jitter": (0.001,)},
        {"count": 2},
        {"pose": "random"},
        {"placing": "scatter"},
    ],
)
def test_unusable_stacks_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        replace(TOWER, **settings)


def test_what_rests_untouched_sleeps_and_does_not_move() -> None:
    scene = build_scene(TOWER, 0)
    simulation = Simulation(scene)
    simulation.step(500)
    before = poses(scene, simulation.data)
    assert simulation.data.ntree_awake == 1  # the robot
    simulation.step(500)
    np.testing.assert_array_equal(poses(scene, simulation.data), before)


def test_what_loses_its_support_wakes_and_falls() -> None:
    scene = build_scene(TOWER, 0)
    simulation = Simulation(scene)
    simulation.step(500)
    lowest = scene.model.body(scene.objects[0])
    # knock the lowest one out from under the others
    simulation.data.xfrc_applied[lowest.id, :3] = [0.0, 5.0, 0.0]
    simulation.step(150)
    simulation.data.xfrc_applied[:] = 0.0
    simulation.step(600)
    assert poses(scene, simulation.data)[1:, 2].max() < 0.045


def test_a_reset_simulation_forgets_who_slept() -> None:
    scene = build_scene(TOWER, 0)
    simulation = Simulation(scene)
    top = scene.model.body(scene.objects[2])
    hashes = []
    for _ in range(2):
        simulation.reset()
        assert simulation.data.ntree_awake > 1
        simulation.step(500)
        assert simulation.data.ntree_awake == 1
        simulation.data.xfrc_applied[top.id, :3] = [0.0, 1.0, 0.0]
        simulation.step(100)
        simulation.data.xfrc_applied[:] = 0.0
        simulation.step(300)
        hashes.append(simulation.state_hash())
    assert hashes[0] == hashes[1]


def test_a_height_map_can_look_at_the_present_state() -> None:
    scene = build_scene(TOWER, 0)
    simulation = Simulation(scene)
    joint = scene.model.joint(f"{scene.objects[2]}/free")
    simulation.data.qpos[joint.qposadr[0]] += 0.15
    mujoco.mj_forward(scene.model, simulation.data)
    then, now = scene.height_map(), scene.height_map(data=simulation.data)
    assert now.height.max() == pytest.approx(0.06, abs=0.001)
    row, col = np.argwhere(now.label == 3).mean(axis=0)
    before = np.argwhere(then.label == 3).mean(axis=0)
    assert (col - before[1]) * now.cell == pytest.approx(0.15, abs=0.003)
    assert row == pytest.approx(before[0], abs=1.0)
