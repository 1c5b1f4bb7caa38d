"""On a recording of an episode a detector and a controller do what they did in it, without a simulator."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mpgrasp.controllers import make_controller
from mpgrasp.detectors import make_detector
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import run_episode
from mpgrasp.geometry import invert
from mpgrasp.linear_algebra import product
from mpgrasp.offline.__main__ import main
from mpgrasp.offline.recorded import CAMERA, COLUMNS, POSES, Recording
from mpgrasp.offline.run import play
from mpgrasp.recording.recorder import NullRecorder, TickRecord
from mpgrasp.scene.config import SceneConfig

SCENE = SceneConfig(objects=("usb_stick",), half_extent=0.08)
CONFIG = EpisodeConfig(camera_backend="ray", start_height=0.3)


class Camera(NullRecorder):
    """Records an episode as a robot's computer would, and what was commanded."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.rows: list[list[Any]] = []
        self.twists: list[np.ndarray] = []

    def tick(self, record: TickRecord) -> None:
        if record.frame is None or record.command is None:
            return
        frame, k = record.frame, record.frame.intrinsics
        if not self.rows:
            lens = {"fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "unit": 1, "no_return": []}
            (self.folder / CAMERA).write_text(json.dumps(lens | {"T_tcp_camera": MOUNT.tolist()}))
        name = f"{len(self.rows):04d}.npy"
        np.save(self.folder / name, frame.depth)
        T = product(frame.T_world_camera, invert(MOUNT))
        quaternion = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)
        self.rows.append([name, repr(frame.time), *map(repr, map(float, (*T[:3, 3], *quaternion)))])
        self.twists.append(record.command.twist)

    def finish(self, event: str) -> None:
        with (self.folder / POSES).open("w", newline="") as file:
            csv.writer(file).writerows([COLUMNS, *self.rows])


MOUNT = np.array([[0.0, -1, 0, 0.07], [1, 0, 0, 0], [0, 0, 1, -0.0634], [0, 0, 0, 1]])
"""Pose of the simulated camera in the tool's frame, to a tenth of a millimetre."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Camera, Any]:
    folder = tmp_path_factory.mktemp("recording")
    camera = Camera(folder)
    result = run_episode(
        SCENE, 3, detector=make_detector("heuristic"), controller=make_controller("mppc_robust"),
        config=CONFIG, recorder=camera,
    )  # fmt: skip
    return folder, camera, result


def test_what_is_commanded_is_what_was_commanded(recorded: tuple[Path, Camera, Any]) -> None:
    folder, camera, result = recorded
    controller = make_controller("mppc_robust")
    steps = list(play(Recording(folder), make_detector("heuristic"), controller))
    assert len(steps) == len(camera.twists) == result.ticks
    assert steps[-1].command.done
    # the first heading is drawn by the seed, which a recording does not have; once there is a peak it is idle
    twists = np.array([step.command.twist for step in steps])
    np.testing.assert_allclose(twists[3:], np.array(camera.twists)[3:], atol=2e-3)
    grasp = steps[-1].grasp
    assert grasp is not None
    np.testing.assert_allclose(grasp.position, result.grasp.position, atol=1e-3)
    assert steps[-1].peak > 0.5


def test_the_command_prints_and_writes_a_row_for_each_view(
    recorded: tuple[Path, Camera, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, camera, _ = recorded
    out = tmp_path / "commands.csv"
    assert main([str(folder), "--detector", "heuristic", "--out", str(out)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == len(camera.rows) + 2
    assert said[-1].startswith("mppc_robust is done; its grasp: (0.")
    rows = list(csv.DictReader(out.open()))
    assert [row["file"] for row in rows] == [row[0] for row in camera.rows]
    assert [row["done"] for row in rows] == ["0"] * (len(rows) - 1) + ["1"]
    assert float(rows[-1]["grasp_quality"]) > 0.5


def test_a_recording_that_ends_too_soon_says_so(
    recorded: tuple[Path, Camera, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, camera, _ = recorded
    with (tmp_path / POSES).open("w", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *camera.rows[:2]])
    for name in (CAMERA, "0000.npy", "0001.npy"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    assert main([str(tmp_path), "--detector", "heuristic"]) == 0
    assert "is not done after all 2 views" in capsys.readouterr().out


def test_what_was_found_before_a_broken_image_is_kept(
    recorded: tuple[Path, Camera, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, camera, _ = recorded
    with (tmp_path / POSES).open("w", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *camera.rows[:3]])
    for name in (CAMERA, "0000.npy", "0001.npy"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    out = tmp_path / "commands.csv"
    assert main([str(tmp_path), "--detector", "heuristic", "--out", str(out)]) == 2
    assert "0002.npy" in capsys.readouterr().err
    assert [row["file"] for row in csv.DictReader(out.open())] == ["0000.npy", "0001.npy"]


def test_nobody_knows_the_truth_of_a_recording(
    recorded: tuple[Path, Camera, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(recorded[0]), "--detector", "oracle"]) == 2
    assert "nobody knows the truth of a recording; got 'oracle'" in capsys.readouterr().err
    assert main(["nowhere"]) == 2
    assert "camera.json" in capsys.readouterr().err


def test_no_simulator_is_loaded(recorded: tuple[Path, Camera, Any]) -> None:
    code = (
        "import sys; from mpgrasp.offline.__main__ import main\n"
        f"main([{str(recorded[0])!r}, '--detector', 'heuristic'])\n"
        "print(sorted({'mujoco', 'mink', 'OpenGL', 'torch'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr
