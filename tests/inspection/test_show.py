"""Laws of the pictures that show what detectors make of a frame, and of the command that draws them."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from height_maps import height_map
from PIL import Image

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors.__main__ import main
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import GraspMap, best_pixel
from mpgrasp.inspection.pictures import DISTANCE, RECTANGLES, Prediction, side_by_side, top_grasps
from mpgrasp.inspection.viewpoint import Viewpoint, timed_prediction
from mpgrasp.recording.false_colour import HOLE

INTRINSICS = CameraIntrinsics(fx=240.0, fy=240.0, cx=111.5, cy=111.5, width=224, height=224)
POSE = looking_down([0.5, 0.0, 0.5])
BLUE = (60, 140, 255)
"""Colour of the best rectangle, as in the paper's Fig. 7."""


def frame(depth: FloatArray | None = None) -> DepthFrame:
    depth = np.full((224, 224), 0.5) if depth is None else depth
    return DepthFrame(depth=depth.astype(np.float32), intrinsics=INTRINSICS, T_world_camera=POSE)


def grasp_map(quality: FloatArray, depth: float = 0.5) -> GraspMap:
    return GraspMap(
        quality=quality.astype(np.float32),
        angle=np.full(quality.shape, 0.3, np.float32),
        width=np.full(quality.shape, 24.0, np.float32),
        depth=np.full(quality.shape, depth, np.float32),
        intrinsics=INTRINSICS,
        T_world_camera=POSE,
    )


def view(quality: FloatArray, name: str = "some") -> Prediction:
    return Prediction(name=name, grasp_map=grasp_map(quality), milliseconds=1.0, first_milliseconds=2.0)


def count(picture: np.ndarray, colour: tuple[int, ...]) -> int:
    return int((picture == colour).all(axis=-1).sum())


NOISE = np.random.default_rng(0).uniform(size=(224, 224))
EMPTY = np.zeros((224, 224))
HILL = np.exp(-((np.indices((224, 224)) - [[[60]], [[150]]]) ** 2).sum(axis=0) / 200)


def test_at_most_five_grasps_none_closer_than_the_suppression_distance() -> None:
    centres = [(r.u, r.v) for _, r in top_grasps(grasp_map(NOISE))]
    assert len(centres) == RECTANGLES == 5
    assert all(
        np.hypot(a[0] - b[0], a[1] - b[1]) >= DISTANCE - 1e-3 for a, b in itertools.combinations(centres, 2)
    )


def test_grasps_come_best_first_and_one_hill_has_one() -> None:
    qualities = [grasp.quality for grasp, _ in top_grasps(grasp_map(NOISE))]
    assert qualities == sorted(qualities, reverse=True)
    ((_, rectangle),) = top_grasps(grasp_map(HILL))
    assert (rectangle.u, rectangle.v) == pytest.approx((150, 60), abs=1e-3)
    # 24 px and fingers of 20 mm, half a metre away at 240 px
    assert (rectangle.width_px, rectangle.jaw_px) == pytest.approx((24, 9.6))
    assert rectangle.angle == pytest.approx(0.3)


def test_of_a_flat_top_the_first_is_what_the_loop_takes() -> None:
    flat = (HILL > 0.5).astype(float)
    grasp, _ = top_grasps(grasp_map(flat))[0]
    assert np.array_equal(grasp.position, grasp_map(flat).grasp_at(*best_pixel(flat)).position)


@pytest.mark.parametrize("quality", [EMPTY, EMPTY + 0.05, EMPTY * np.nan], ids=["zero", "low", "nan"])
def test_a_map_that_says_nothing_has_no_grasp_and_no_rectangle(quality: FloatArray) -> None:
    assert top_grasps(grasp_map(quality)) == []
    assert "no grasp" in view(quality).lines()[-1]
    unmarked = count(side_by_side(frame(), [view(EMPTY)]), BLUE)  # the legend
    assert count(side_by_side(frame(), [view(quality)]), BLUE) == unmarked
    assert count(side_by_side(frame(), [view(HILL)]), BLUE) > unmarked


def test_pixels_without_depth_have_no_grasp() -> None:
    assert top_grasps(grasp_map(NOISE, depth=np.nan)) == []
    blind = Prediction(
        name="blind", grasp_map=grasp_map(EMPTY, depth=np.nan), milliseconds=1.0, first_milliseconds=1.0
    )
    side_by_side(frame(np.full((224, 224), np.nan)), [blind])


def test_every_detector_adds_a_column_of_the_same_size() -> None:
    sizes = [side_by_side(frame(), [view(HILL, str(k)) for k in range(n)]).shape for n in (1, 2, 3)]
    heights, widths, channels = zip(*sizes, strict=True)
    assert len(set(heights)) == 1
    assert set(channels) == {3}
    assert widths[1] - widths[0] == widths[2] - widths[1] > 224
    with pytest.raises(ConfigError):
        side_by_side(frame(), [])


def test_what_the_camera_did_not_see_is_grey() -> None:
    depth = np.full((224, 224), 0.5)
    depth[56:112, 112:168] = np.nan
    whole = count(side_by_side(frame(), [view(EMPTY)]), HOLE)
    holed = count(side_by_side(frame(depth), [view(EMPTY)]), HOLE) - whole
    # a quarter of the panel each way, a panel being a column less its gap, and a hole's edge being blended
    column = side_by_side(frame(), [view(EMPTY)] * 2).shape[1] - side_by_side(frame(), [view(EMPTY)]).shape[1]
    assert np.sqrt(holed) == pytest.approx(column / 4, abs=4)


def test_the_first_call_is_told_apart_from_the_warm_ones() -> None:
    class Counts:
        name, calls = "counts", 0

        def reset(self, truth: object) -> None: ...

        def predict(self, frame: DepthFrame) -> GraspMap:
            self.calls += 1
            return grasp_map(EMPTY + self.calls / 100)

    counts = Counts()
    counts.reset(height_map())
    timed = timed_prediction("counts", counts, frame())
    assert counts.calls > 3
    assert timed.first_milliseconds > 0
    assert timed.milliseconds > 0


@pytest.mark.parametrize("height", [0.0, -0.1, 1.5, np.nan, np.inf])
def test_a_height_that_cannot_be_is_refused(height: float) -> None:
    with pytest.raises(ConfigError, match="height"):
        Viewpoint(height=height)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ([], "required: show|check|card"),
        (["show", "resnet"], "unknown detector; got 'resnet'"),
        (["show", "oracle,oracle"], "unusable list of detectors"),
        (
            ["show", "oracle", "--set", "controller.gamma=1"],
            "gamma has no effect on a single look",
        ),
        (["show", "oracle", "--set", "sensor.subpixel=-1"], "--set sensor: subpixel of the depth sensor"),
        (["show", "oracle", "--set", "detector.crop=1"], "detector.crop: no setting of oracle"),
        (["show", "oracle", "--no-noise", "--set", "sensor.subpixel=1"], "has no effect; got '--no-noise'"),
        (["show", "oracle", "--suite", "thick"], "unknown suite"),
        (["show", "oracle", "--seed", "-1"], "--seed: unusable number; got '-1'"),
        (["show", "oracle", "--height", "0.95"], "out of reach"),
        (["show", "oracle", "--height", "low"], "--height: unusable number; got 'low'"),
        (["show", "oracle", "--camera", "film"], "camera backend"),
        (["show", "oracle", "--weights", "some.pt"], "some.pt"),
        (["show", "oracle", "--above-object", "cup"], "no such object in this scene; got 'cup'"),
        (["show", "oracle", "--out", "some.jpg"], "got 'some.jpg'; allowed: .png"),
        (["card", "oracle"], "without a training card"),
        (["card", "dhrnet", "--weights", "absent.safetensors"], "no such weights file"),
    ],
)
def test_unusable_input_is_one_line_and_exit_code_2(
    command: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command) == 2
    error = capsys.readouterr().err
    assert error.startswith("mpgrasp: error: ")
    assert error.count("\n") == 1
    assert message in error


def test_a_card_tells_the_network_and_how_it_was_trained(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from mpgrasp.detectors.networks.registry import build_network
    from mpgrasp.detectors.networks.weights import NetworkWeights, save_weights

    file = tmp_path / "some.safetensors"
    network = build_network("ggcnn2", {})
    save_weights(
        file, NetworkWeights(name="ggcnn2", network=network, settings={}, card={"loss": {"beta": 0.2}})
    )
    assert main(["card", "ggcnn2", "--weights", str(file)]) == 0
    printed = capsys.readouterr().out
    assert "network: ggcnn2\n" in printed
    assert f"parameters: {sum(p.numel() for p in network.parameters())}\n" in printed
    assert "training:\n  loss:\n    beta: 0.2\n" in printed
    assert main(["card", "dhrnet", "--weights", str(file)]) == 2
    assert "another network" in capsys.readouterr().err


def test_the_command_draws_the_oracle_s_view_and_says_what_it_found(tmp_path: Path) -> None:
    out = tmp_path / "new" / "thin.png"
    options = ["--suite", "thin", "--seed", "3", "--height", "0.3", "--above-object", "--out", str(out)]
    done = _command("show", "oracle", *options)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "oracle: best Q 0." in done.stdout
    assert f"Picture: {out}" in done.stdout
    with Image.open(out) as picture:
        assert picture.size == side_by_side(frame(), [view(EMPTY)]).shape[1::-1]
        assert count(np.asarray(picture), BLUE) > count(side_by_side(frame(), [view(EMPTY)]), BLUE)


def test_the_command_ends_with_code_2_for_a_detector_that_is_not_there() -> None:
    done = _command("show", "resnet")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("mpgrasp: error: unknown detector; got 'resnet'")


def _command(*arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    return subprocess.run(
        [sys.executable, "-m", "mpgrasp.detectors", *arguments],
        capture_output=True,
        text=True,
        env=environment,
        timeout=300,
    )
