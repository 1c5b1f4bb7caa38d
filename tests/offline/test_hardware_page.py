"""The code of docs/hardware.md grasps with an arm behind three functions: here the simulated one."""

from __future__ import annotations

import re
import time
from typing import Any

import numpy as np
import pytest

from mpgrasp.controllers import make_controller
from mpgrasp.detectors import make_detector
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import Episode
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp
from mpgrasp.outcome import Outcome
from mpgrasp.paths import BENCHMARKS
from mpgrasp.scene.config import SceneConfig

PAGE = (BENCHMARKS.parent / "docs" / "hardware.md").read_text(encoding="utf-8")


class Robot:
    """Camera and arm as the page asks for them."""

    def __init__(self) -> None:
        scene = SceneConfig(objects=("usb_stick",), half_extent=0.05)
        config = EpisodeConfig(camera_backend="ray", start_height=0.3)
        self.episode = Episode(scene, 3, detector=make_detector("heuristic"), config=config)
        self.outcome: Outcome | None = None
        self.moves = 0

    def frame(self) -> tuple[Any, ...]:
        data = self.episode.simulation.data
        seen = self.episode.camera.capture(data, np.random.default_rng(self.moves))
        readings = np.nan_to_num(1000 * seen.depth).round().astype(np.uint16)
        return readings, 0.001, seen.intrinsics, seen.T_world_camera

    def pose(self) -> FloatArray:
        return self.episode.simulation.T_world_tcp

    def joints(self) -> FloatArray:
        return np.array(self.episode.driver.q)

    def move(self, twist: FloatArray) -> None:
        self.moves += 1
        self.episode.driver.drive(np.asarray(twist), 0.1)

    def execute(self, grasp: Grasp) -> None:
        self.outcome = self.episode.attempt(grasp).outcome


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Names that the page's code defines; nobody waits for an arm that moves in no time."""
    names: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(block, names)
    monkeypatch.setattr(time, "sleep", lambda seconds: None)
    return names


def test_the_loop_of_the_page_grasps(page: dict[str, Any]) -> None:
    robot = Robot()
    grasp = page["grasp_once"](
        robot, robot, make_detector("heuristic"), make_controller("mppc_robust"), page["allowed"]
    )
    robot.episode.close()
    assert grasp is not None
    assert robot.outcome is Outcome.SUCCESS
    assert 20 < robot.moves < 60


def test_what_is_not_allowed_stops_the_arm(page: dict[str, Any]) -> None:
    robot = Robot()
    grasp = page["grasp_once"](
        robot, robot, make_detector("heuristic"), make_controller("mppc_robust"), lambda q, twist: False
    )
    robot.episode.close()
    assert (grasp, robot.outcome, robot.moves) == (None, None, 1)


def test_the_check_of_the_page_knows_what_the_arm_cannot_do(page: dict[str, Any]) -> None:
    ik, home = page["ik"], np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
    assert page["allowed"](home, np.array([0.1, 0.0, -0.05, 0, 0, 0]))
    assert not page["allowed"](home, np.array([50.0, 0, 0, 0, 0, 0]))
    stretched = home.copy()
    stretched[[1, 3, 5]] = [0.9, -0.15, 1.6]
    assert not page["allowed"](stretched, np.zeros(6)), ik.pose(stretched)
