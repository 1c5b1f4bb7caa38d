"""Laws of the study of detection against thickness: what its counts mean, and that they come again."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mpgrasp.controllers.config import ReachConfig
from mpgrasp.depth import DepthFrame, crop_resize, inpaint
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.grasp import GraspMap, world_to_image_angle
from mpgrasp.height_map import HeightMap


@pytest.fixture(scope="module")
def thickness() -> ModuleType:
    return importlib.import_module("thickness")


def some_map(frame: DepthFrame, row: int, col: int, angle: float, quality: float) -> GraspMap:
    """A grasp map with one peak of 3x3 px."""
    image = crop_resize(frame)
    shape = image.depth.shape
    q = np.zeros(shape, np.float32)
    q[row - 1 : row + 2, col - 1 : col + 2] = quality
    return GraspMap(
        quality=q,
        angle=np.full(shape, angle, np.float32),
        width=np.full(shape, 20, np.float32),
        depth=inpaint(image.depth),
        intrinsics=image.intrinsics,
        T_world_camera=image.T_world_camera,
    )


class Perfect:
    """Is told where the stick lies, and grasps its middle at `turn` to its short axis."""

    name, reads_truth = "perfect", True

    def __init__(self, quality: float = 1.0, turn: float = 0.0) -> None:
        self.quality, self.turn = quality, turn

    def reset(self, truth: HeightMap | None) -> None:
        assert truth is not None
        row, col = np.nonzero(truth.label)
        self.points = np.column_stack([truth.x0 + col * truth.cell, truth.y0 + row * truth.cell])

    def predict(self, frame: DepthFrame) -> GraspMap:
        if not len(self.points):
            return some_map(frame, 100, 100, 0.0, 0.0)
        middle = self.points.mean(axis=0)
        short = np.linalg.eigh(np.cov((self.points - middle).T))[1][:, 0]
        angle = world_to_image_angle(np.arctan2(short[1], short[0]) + self.turn, frame.T_world_camera)
        u, v = np.rint(crop_resize(frame).pixels(np.array([*middle, 0.005]))).astype(int)
        return some_map(frame, v, u, float(angle), self.quality)


class Blind:
    name = "blind"

    def reset(self, truth: HeightMap | None) -> None:
        assert truth is None

    def predict(self, frame: DepthFrame) -> GraspMap:
        return some_map(frame, 100, 100, 0.0, 0.0)


class Guesses(Blind):
    def __init__(self) -> None:
        self.rng = np.random.default_rng(0)

    def predict(self, frame: DepthFrame) -> GraspMap:
        row, col = self.rng.integers(5, 219, 2)
        return some_map(frame, row, col, self.rng.uniform(-1.5, 1.5), 1.0)


class Unfinished(Blind):
    """Nothing but NaN."""

    def predict(self, frame: DepthFrame) -> GraspMap:
        return some_map(frame, 100, 100, np.nan, np.nan)


def test_what_counts_as_what(thickness: ModuleType) -> None:
    study = thickness.Study(thicknesses=(2.0, 12.0), heights=(0.175, 0.5), scenes=3)
    detectors = {
        "perfect": Perfect(),
        "shy": Perfect(quality=ReachConfig().peak_threshold - 0.01),
        "along": Perfect(turn=np.pi / 2),
        "blind": Blind(),
        "guesses": Guesses(),
        "nan": Unfinished(),
    }
    cells = thickness.run(study, detectors)
    assert len(cells) == len(detectors) * 3 * 2
    rates = {
        "perfect": {"detected": 1, "false_peak": 0, "no_peak": 0, "right": 1},
        "shy": {"detected": 0, "false_peak": 0, "no_peak": 1, "right": 1},
        "along": {"detected": 0, "false_peak": 1, "no_peak": 0, "right": 0},
        "blind": {"detected": 0, "false_peak": 0, "no_peak": 1, "right": 0},
        "guesses": {"detected": 0, "false_peak": 1, "no_peak": 0, "right": 0},
        "nan": {"detected": 0, "false_peak": 0, "no_peak": 1, "right": 0},
    }
    for cell in cells:
        bare = cell["thickness_mm"] == 0
        expected = {"false_peak": int(cell["detector"] == "guesses")} if bare else rates[cell["detector"]]
        assert {k: cell[k]["rate"] for k in expected} == expected, cell
        assert ("detected" in cell) is not bare
        for what in expected:
            assert cell[what]["wilson_low"] <= cell[what]["rate"] <= cell[what]["wilson_high"]


@pytest.mark.parametrize(
    ("along", "aside", "turn", "right"),
    [
        (0.0, 0.0, 0, True),
        (24, 0, 0, True),
        (24, 4.5, 29, True),
        (31, 0, 0, False),
        (0, 6, 0, False),
        (0, -6, 0, False),
        (-29.5, 4, 0, False),
        (0, 0, 31, False),
        (0, 0, 150.5, True),
        (0, 0, np.nan, False),
    ],
)
def test_a_right_grasp_is_near_the_axis_off_the_ends_and_across(
    thickness: ModuleType, along: float, aside: float, turn: float, right: bool
) -> None:
    yaw = 0.7
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    at: FloatArray = np.array([0.45, 0.03, 0.002]) + R @ [along / 1000, aside / 1000, 0.0]
    down = np.diag([1.0, -1.0, -1.0])
    k = crop_resize(_flat_frame(transform(down, [at[0], at[1], 0.5]))).intrinsics
    frame = _flat_frame(transform(down, [at[0] + 0.5 / k.fx * 0.5, at[1] - 0.5 / k.fy * 0.5, 0.5]))
    # the middle of 224 px lies between pixels 111 and 112
    grasp_map = some_map(frame, 111, 111, yaw + np.pi / 2 + np.deg2rad(turn), 1.0)
    pose = np.vstack([R, [0.45, 0.03, 0.002]])
    assert thickness.is_right(grasp_map, pose) is right


def _flat_frame(T_world_camera: FloatArray) -> DepthFrame:
    from mpgrasp.camera.config import D435_INTRINSICS

    depth = np.full((350, 350), 0.5, np.float32)
    return DepthFrame(depth=depth, intrinsics=D435_INTRINSICS.centre_crop(350), T_world_camera=T_world_camera)


def test_the_same_seed_gives_the_same_file_and_a_picture(
    thickness: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study = importlib.import_module("study")
    monkeypatch.setattr(
        study, "load_detector", lambda name, weights: {"guesses": Guesses, "blind": Blind}[name]()
    )
    command = ["--detector", "guesses,blind", "--scenes", "1", "--seed", "4", "--out", str(tmp_path / "new")]
    texts = []
    for _ in range(2):
        assert thickness.main(command) == 0
        files = ("run.json", "thickness.json", "thickness.csv", "thickness.png")
        texts.append([(tmp_path / "new" / name).read_bytes() for name in files])
    assert texts[0] == texts[1]
    run: dict[str, Any] = json.loads(texts[0][0])
    assert run["study"]["seed"] == 4
    assert len(run["scene_seeds"]) == 1
    assert len(json.loads(texts[0][1])["cells"]) == len(texts[0][2].splitlines()) - 1 == 2 * 9 * 4
    with Image.open(tmp_path / "new" / "thickness.png") as picture:
        assert picture.width > picture.height > 300
    printed = capsys.readouterr().out
    assert printed.count(" guesses ") == printed.count(" blind ") == 2 * 9


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["--scenes", "0"], "--scenes: unusable number; got '0'"),
        (["--scenes", "few"], "--scenes: unusable number; got 'few'"),
        (["--seed", "-1"], "--seed: unusable number; got '-1'"),
        (["--camera", "film"], "invalid choice"),
        (["--detector", "resnet"], "unknown detector"),
        (["--detector", "dhrnet,"], "unknown detector; got ''"),
        (["--detector", "oracle", "--out", "/dev/null/x"], "cannot be written"),
        (["--colour"], "--colour"),
    ],
)
def test_unusable_input_is_one_line_and_exit_code_2(
    thickness: ModuleType, command: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert thickness.main(command) == 2
    error = capsys.readouterr().err
    assert error.startswith("mpgrasp: error: ")
    assert error.count("\n") == 1
    assert message in error
