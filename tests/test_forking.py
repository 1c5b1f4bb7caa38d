"""In a forked process what would hang is refused with the remedy, and all else works."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mpgrasp.camera.rasteriser import require_gl
from mpgrasp.exceptions import CameraError

LIMIT = 150.0
"""Longest that one of these programs may take [s]; each starts two processes and builds a few scenes."""
ROOT = Path(__file__).resolve().parents[1]

PREAMBLE = """
import sys
import numpy as np
from gymnasium.vector import AsyncVectorEnv
from mpgrasp.env import GraspEnv
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.exceptions import MpgraspError

RAY = EpisodeConfig(camera_backend="ray", noise=False)
GL = EpisodeConfig(camera_backend="gl", noise=False)

class Make:
    def __init__(self, detector, config):
        self.detector, self.config = detector, config
    def __call__(self):
        return GraspEnv("thin", self.detector, self.config)

def play(context, detector, config):
    vector = AsyncVectorEnv([Make(detector, config)] * 2, context=context)
    try:
        observed, _ = vector.reset(seed=7)
        observed, *_ = vector.step(np.zeros((2, 4)))
        print("played", observed["depth"].shape, flush=True)
    except MpgraspError as error:
        print("refused", error, flush=True)
    finally:
        vector.close(terminate=True)

def use(detector, config):
    env = GraspEnv("thin", detector, config)
    env.reset(seed=0)
    return env

if __name__ == "__main__":
"""


def run(code: str, folder: Path, threads: str = "2") -> str:
    """Run a program of those words in a process of its own, and return what it prints."""
    program = folder / "program.py"
    program.write_text(PREAMBLE + "\n".join(f"    {line}" for line in code.splitlines()))
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": threads}
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, env=environment, timeout=LIMIT
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.fixture
def gl() -> None:
    try:
        require_gl()
    except CameraError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("detector", ["oracle", "ggcnn2"])
def test_a_process_that_has_used_nothing_may_fork_environments(detector: str, tmp_path: Path) -> None:
    assert run(f'play("fork", "{detector}", RAY)', tmp_path) == "played (2, 224, 224)"


def test_environments_that_fork_may_use_opengl_unless_their_parent_has(gl: None, tmp_path: Path) -> None:
    said = run('play("fork", "oracle", GL); use("oracle", GL); play("fork", "oracle", GL)', tmp_path)
    first, second = said.splitlines()
    assert first == "played (2, 224, 224)"
    assert second.startswith("refused OpenGL was started before this process was forked")
    assert 'context="spawn"' in second


def test_rays_and_the_oracle_survive_a_fork_from_a_parent_that_used_them(tmp_path: Path) -> None:
    assert run('use("oracle", RAY); play("fork", "oracle", RAY)', tmp_path) == "played (2, 224, 224)"


def test_a_network_in_a_fork_of_a_parent_that_used_one_is_refused(tmp_path: Path) -> None:
    said = run('use("ggcnn2", RAY); play("fork", "ggcnn2", RAY)', tmp_path)
    assert said.startswith("refused ")
    assert "was started before this process was forked" in said
    assert 'context="spawn"' in said


def test_spawned_environments_work_after_anything(gl: None, tmp_path: Path) -> None:
    said = run('use("ggcnn2", GL); play("spawn", "ggcnn2", GL)', tmp_path)
    assert said == "played (2, 224, 224)"


def test_what_was_made_before_a_fork_refuses_to_go_on_in_it(gl: None, tmp_path: Path) -> None:
    code = """
import multiprocessing
from mpgrasp.detectors import make_detector
env = use(make_detector("ggcnn2"), GL)
def go_on():
    for name, call in (("step", lambda: env.step(np.zeros(4))), ("reset", env.reset)):
        try:
            call()
        except MpgraspError as error:
            print(name, str(error).split(" was started")[0], flush=True)
    env.close()
    print("closed", flush=True)
child = multiprocessing.get_context("fork").Process(target=go_on)
child.start()
child.join(60)
print("hangs" if child.is_alive() else child.exitcode)
child.kill()
env.step(np.zeros(4))
"""
    assert run(code, tmp_path).splitlines() == ["step OpenGL", "reset OpenGL", "closed", "0"]


def test_a_runtime_made_before_a_fork_refuses_to_go_on_in_it(tmp_path: Path) -> None:
    code = """
import multiprocessing
import torch
torch.set_num_threads(2)  # on one thread torch survives a fork
from mpgrasp.detectors.network_detector import NetworkDetector
image = np.zeros((224, 224), np.float32)
made = [NetworkDetector.load("ggcnn2", runtime=name) for name in sys.argv[1:] or ["torch", "auto"]]
for detector in made:
    detector.grasp_arrays(image)
def go_on():
    for detector in made:
        try:
            detector.grasp_arrays(image)
        except MpgraspError as error:
            print("refused", flush=True)
child = multiprocessing.get_context("fork").Process(target=go_on)
child.start()
child.join(60)
print("hangs" if child.is_alive() else child.exitcode)
child.kill()
"""
    assert run(code, tmp_path).splitlines() == ["refused", "refused", "0"]
