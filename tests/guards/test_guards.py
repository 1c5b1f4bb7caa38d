"""What a plug-in returns is checked before it counts, in every way of playing an episode."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_plug_ins import GUARDED, SOUND_CONTROLLER, SOUND_DETECTOR, BadPlugIn
from scripted import Scripted
from toy_networks import frame
from toy_ticks import OBJECT, observe
from toy_views import flat_map

from mpgrasp.controllers import CONTROLLERS, make_controller
from mpgrasp.controllers.controller import Command
from mpgrasp.depth import DepthFrame
from mpgrasp.env import GraspEnv
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import run_episode
from mpgrasp.exceptions import ConfigError, MpgraspError, PlugInError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.guards.asking import ask_controller, ask_detector, ask_diagnostics, ask_final_grasp
from mpgrasp.guards.command import check_command, check_final_grasp
from mpgrasp.guards.grasp_map import check_grasp_map
from mpgrasp.scene.config import SceneConfig

SCENE = SceneConfig(objects=("usb_stick",))
QUICK = EpisodeConfig(camera_backend="ray", noise=False)


def made(source: str, name: str = "Bad") -> Any:
    """Return an instance of a class of a module's text."""
    space: dict[str, Any] = {"__name__": "plugged"}
    exec(source, space)  # text of this project
    return space[name]()


def ask(bad: BadPlugIn) -> None:
    """Ask a plug-in what an episode would ask it."""
    plug_in = made(bad.source)
    if bad.kind == "detector":
        plug_in.reset(None)
        ask_detector(plug_in, frame())
        return
    plug_in.reset(0)
    ask_controller(plug_in, observe((0.43, 0.0, 0.4), OBJECT))
    ask_diagnostics(plug_in)
    ask_final_grasp(plug_in)


@pytest.mark.filterwarnings("ignore:coroutine")
@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("name", GUARDED)
def test_a_plug_in_that_returns_what_cannot_be_is_refused_with_what_came_and_what_is_allowed(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MpgraspError, match=GUARDED[name].said) as refused:
        ask(GUARDED[name])
    assert "allowed: " in str(refused.value)
    assert os.getcwd() == str(tmp_path)


def test_sound_plug_ins_are_let_pass() -> None:
    detector, controller = made(SOUND_DETECTOR, "Sound"), made(SOUND_CONTROLLER, "Sound")
    detector.reset(None)
    seen = ask_detector(detector, frame())
    assert seen.quality.max() > 0.5
    controller.reset(0)
    command = ask_controller(controller, replace(observe((0.5, 0.0, 0.4)), grasp_map=seen))
    assert command.twist[2] < 0
    assert ask_final_grasp(controller) is not None


@pytest.mark.parametrize("name", CONTROLLERS)
def test_the_projects_own_controllers_are_let_pass(name: str) -> None:
    controller = make_controller(name)
    controller.reset(0)
    for height in (0.5, 0.3, 0.17):
        ask_controller(controller, observe((0.43, 0.0, height), OBJECT))
    assert ask_final_grasp(controller) is not None
    assert ask_diagnostics(controller)


def moved(T: FloatArray) -> FloatArray:
    """A pose as it is after a round trip through single precision."""
    return T.astype(np.float32).astype(float)


NEARLY: dict[str, Callable[[GraspMap], GraspMap]] = {
    "rounded": lambda m: replace(m, quality=np.full_like(m.quality, 1 + 1e-6)),
    "double": lambda m: replace(m, quality=m.quality.astype(float), angle=m.angle.astype(float)),
    "half-a-turn": lambda m: replace(m, angle=np.full_like(m.angle, np.float32(np.pi / 2))),
    "nothing": lambda m: replace(m, quality=0 * m.quality, width=0 * m.width),
    "unsure-and-thin": lambda m: replace(m, quality=0 * m.quality + 0.2, width=0 * m.width + 0.5),
    "blind": lambda m: replace(m, quality=0 * m.quality, depth=m.depth * np.nan),
    "no-time": lambda m: replace(m, time=0.0),
    "pose-rounded": lambda m: replace(
        m, T_world_camera=m.T_world_camera + 1e-9 * (np.arange(16) < 12).reshape(4, 4)
    ),
}


@pytest.mark.parametrize("change", NEARLY.values(), ids=NEARLY)
def test_what_is_meant_well_is_let_pass(change: Callable[[GraspMap], GraspMap]) -> None:
    image = frame()
    view = change(flat_map(0.5, image.T_world_camera))
    assert check_grasp_map(view, image, "detector d") is view


def test_numbers_of_numpy_are_numbers() -> None:
    small: Any = np.float32(0.08)
    truth: Any = np.bool_(True)
    command = Command(twist=np.zeros(6, int), gripper=small, done=truth)
    assert check_command(command, "c") is command
    grasp = Grasp(position=np.zeros(3), angle=small, width=np.float64(0.04), quality=1)
    assert check_final_grasp(grasp, "c") is grasp
    assert check_final_grasp(None, "c") is None


def test_a_map_of_lists_is_no_map() -> None:
    view = flat_map(0.5, frame().T_world_camera)
    with pytest.raises(ConfigError, match="quality is no numpy array"):
        replace(view, quality=[[0.0]])  # type: ignore[arg-type]


class Logits:
    """Speaks of quality as its network does."""

    name = "logits"

    def reset(self, truth: object) -> None: ...

    def predict(self, frame: DepthFrame) -> GraspMap:
        flat = flat_map(0.0, frame.T_world_camera)
        return replace(flat, quality=flat.quality - 4)


def test_every_way_of_playing_an_episode_is_guarded() -> None:
    said = "detector logits: the map's quality is out of range.*from -4 to -4.*allowed: 0 to 1"
    with pytest.raises(PlugInError, match=said):
        run_episode(SCENE, 1, detector=Logits(), controller=make_controller("mppc"), config=QUICK)
    env = GraspEnv("single", Logits(), QUICK)
    with pytest.raises(PlugInError, match=said):
        env.reset(seed=1)
    env.close()
    grasp = Grasp(position=np.array([0.5, 0, 0]), angle=0.0, width=40.0, quality=1.0)
    with pytest.raises(PlugInError, match="controller scripted: the final grasp's width"):
        run_episode(
            SCENE, 1, detector=_Nothing(), controller=Scripted((0,) * 6, ticks=0, grasp=grasp), config=QUICK
        )


class _Nothing(Logits):
    def predict(self, frame: DepthFrame) -> GraspMap:
        return flat_map(0.0, frame.T_world_camera)


def test_a_motion_that_is_too_fast_for_the_robot_is_left_to_the_protective_stop() -> None:
    result = run_episode(SCENE, 1, detector=_Nothing(), controller=Scripted((3, 0, 0, 0, 0, 0)), config=QUICK)
    assert result.reflex is not None
