"""What MuJoCo warns of is an error that names it: nothing jumps, nothing is dropped, no file is left."""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from mpgrasp.exceptions import SimulationError
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.free_hand import FreeHand
from mpgrasp.scene.moving_scene import MovingScene
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.simulation import Simulation
from mpgrasp.scene.watch import Watch, forward

CONFIG = SceneConfig(objects=("usb_stick", "soap"))
Step = Callable[[], None]
BALL = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A working directory in which nothing may be left."""
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not list(tmp_path.iterdir())


def on_the_arm() -> tuple[MovingScene, Step]:
    simulation = Simulation(build_scene(CONFIG, 0))
    return simulation, lambda: simulation.step(5)


def flying() -> tuple[MovingScene, Step]:
    hand = FreeHand(build_scene(CONFIG, 0, robot=False))
    return hand, lambda: hand.step(np.array([0.0, 0.0, 1.0]), 5)


BODIES = pytest.mark.parametrize("carried", [on_the_arm, flying])


def wake(scene: MovingScene) -> None:
    """Give the objects a speed: MuJoCo does not look at those that sleep."""
    for name in scene.scene.objects:
        scene.data.joint(f"{name}/free").qvel[0] = 1e-3


@BODIES
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e12])
@pytest.mark.parametrize(
    ("array", "joint", "names"),
    [
        ("qpos", "panda/finger_joint1", "BADQPOS"),
        ("qpos", "usb_stick/free", "BADQPOS"),
        ("qvel", "soap/free", "BADQVEL"),
        ("qfrc_applied", "soap/free", "BADQACC"),
    ],
)
def test_a_number_that_is_none_ends_the_step_as_an_error_that_names_warning_and_joint(
    carried: Callable[[], tuple[MovingScene, Step]], array: str, joint: str, names: str, value: float
) -> None:
    scene, step = carried()
    wake(scene)
    view = scene.data.joint(joint)
    getattr(view, array)[0] = value
    before = scene.time
    with pytest.raises(SimulationError, match=rf"the simulator (warned|broke off); got '.*{names}") as caught:
        step()
    if array == "qpos":  # what else is no number gets to all joints within the step
        assert f"({joint})" in str(caught.value)
    assert scene.time >= before


def test_the_arm_stays_where_it_is_when_an_object_is_nowhere() -> None:
    simulation = Simulation(build_scene(CONFIG, 0))
    wake(simulation)
    before, away = simulation.q, simulation.object_pose("soap")
    simulation.data.joint("usb_stick/free").qpos[0] = 1e12
    with pytest.raises(SimulationError, match=r"BADQPOS.*usb_stick"):
        simulation.step(5)
    assert np.linalg.norm(before) > 1  # unlike the posture that MuJoCo resets to
    np.testing.assert_allclose(simulation.q, before, atol=1e-4)
    np.testing.assert_allclose(simulation.object_pose("soap"), away, atol=1e-3)


@BODIES
def test_what_was_warned_of_counts_until_the_reset_and_not_beyond(
    carried: Callable[[], tuple[MovingScene, Step]],
) -> None:
    scene, step = carried()
    wake(scene)
    there = scene.data.joint("usb_stick/free").qpos
    kept = there.copy()
    there[0] = 1e12
    with pytest.raises(SimulationError):
        step()
    there[:] = kept  # as if nothing had been
    with pytest.raises(SimulationError, match="BADQPOS"):
        step()
    scene.reset()  # type: ignore[attr-defined]
    step()
    fresh, step_fresh = carried()
    step_fresh()
    np.testing.assert_array_equal(scene.data.qpos, fresh.data.qpos)


def test_contacts_without_memory_are_an_error_and_never_dropped() -> None:
    scene = build_scene(CONFIG, 0)
    spec = scene.spec.copy()
    spec.memory = 30_000
    small: Scene = replace(scene, model=spec.compile())
    with pytest.raises(SimulationError, match=r"arena memory|out of memory"):
        Simulation(small)
    with pytest.raises(SimulationError, match=r"arena memory|out of memory"):
        small.data()


def test_an_object_of_too_many_bodies_is_an_error_as_soon_as_it_touches_the_table() -> None:
    places = [(0.007 * (i % 20 - 10), 0.007 * (i // 20 - 10), 0.0) for i in range(400)]
    parts = tuple(Part(shape="box", size=(0.003,) * 3, position=place) for place in places)
    crumbs = ObjectModel(name="crumbs", parts=parts, mass=0.2, rolls=True)
    with pytest.raises(SimulationError, match=r"CNSTRFULL: Insufficient arena memory|CONTACTFULL"):
        build_scene(SceneConfig(objects=(crumbs,), cloth_unevenness=0.0), 0, robot=False)


def test_a_singular_inertia_is_an_error() -> None:
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    data.warning[mujoco.mjtWarning.mjWARN_INERTIA.value].number = 1  # counted, whoever heard it
    with pytest.raises(SimulationError, match="INERTIA: Inertia matrix is too close to singular"):
        forward(model, data)


def test_what_mujoco_says_without_counting_it_is_an_error_too() -> None:
    model = mujoco.MjModel.from_xml_string(BALL)
    say = mujoco.get_mju_user_warning()
    with (
        pytest.raises(SimulationError, match="WARNING: something is odd"),
        Watch(model, mujoco.MjData(model)),
    ):
        say("something is odd")


def test_an_error_of_ones_own_passes_through_a_watch() -> None:
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    data.qpos[0] = np.nan
    with pytest.raises(ZeroDivisionError), Watch(model, data):
        _warn_and_fail(model, data)


def _warn_and_fail(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    mujoco.mj_step(model, data)
    raise ZeroDivisionError


def test_a_model_of_ones_own_goes_to_the_log_and_blames_nobody(caplog: pytest.LogCaptureFixture) -> None:
    simulation, model = Simulation(build_scene(CONFIG, 0)), mujoco.MjModel.from_xml_string(BALL)

    def elsewhere() -> None:
        data = mujoco.MjData(model)
        data.qpos[0] = np.nan
        mujoco.mj_step(model, data)

    with caplog.at_level(logging.WARNING, logger="mujoco"):
        elsewhere()
        assert "QPOS at DOF 0" in caplog.text
        simulation.step(5)
        with Watch(simulation.model, simulation.data):  # a neighbour in another thread
            thread = threading.Thread(target=elsewhere)
            thread.start()
            thread.join()


PROGRAM = """
import mujoco
heard = []
mujoco.set_mju_user_warning(heard.append)
from mpgrasp import SceneConfig, Simulation, build_scene
from mpgrasp.exceptions import SimulationError
simulation = Simulation(build_scene(SceneConfig(), 0))
simulation.data.qpos[0] = 1e12
try:
    simulation.step(5)
except SimulationError as error:
    print(error)
assert heard, "the program's own handler is gone"
"""


def test_a_handler_of_the_programs_own_stays_and_the_error_comes_all_the_same() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "BADQPOS" in done.stdout


def test_no_world_of_the_project_puts_itself_back() -> None:
    off = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    with_basket = replace(CONFIG, basket=True)
    for scene in (build_scene(CONFIG, 0), build_scene(with_basket, 0), build_scene(CONFIG, 0, robot=False)):
        assert scene.model.opt.disableflags & off
    assert FreeHand(scene).model.opt.disableflags & off
