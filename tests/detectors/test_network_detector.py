"""Laws of a network as a detector: from its raw heads to grasps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from toy_networks import frame, random_weights, weight_files

from mpgrasp.detectors import make_detector
from mpgrasp.detectors.config import NetworkDetectorConfig
from mpgrasp.detectors.detector import reads_colour
from mpgrasp.detectors.network_detector import NetworkDetector, postprocess
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.weights import load_weights
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import line_angle_difference, looking_down, wrap_half_pi
from mpgrasp.grasp import image_to_world_angle
from mpgrasp.robot.hand import GRIPPER_MAX_WIDTH

pytestmark = pytest.mark.usefixtures("network_cache")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path | None]:
    return weight_files(tmp_path_factory.mktemp("weights"))


def test_doubled_angles_survive_the_wrap() -> None:
    theta = np.where(np.indices((40, 40))[1] < 20, np.pi / 2 - 0.01, -np.pi / 2 + 0.01)
    heads = np.stack([np.ones((40, 40)), np.cos(2 * theta), np.sin(2 * theta), np.ones((40, 40))])
    _, angle, width = postprocess(heads.astype(np.float32), 112.0)
    assert line_angle_difference(angle, np.pi / 2).max() < 0.02
    assert np.allclose(width, 112.0, rtol=1e-5)


def test_turning_the_scene_s_frame_turns_nothing_in_the_image(files: dict[str, Path | None]) -> None:
    made = make_detector("dhrnet", files["dhrnet"])
    first = made.predict(frame())
    turned = made.predict(frame(T=looking_down([0.5, 0.0, 0.4], 1.0)))
    assert np.array_equal(first.angle, turned.angle)
    before, after = (image_to_world_angle(m.angle, m.T_world_camera) for m in (first, turned))
    assert np.allclose(np.mod(after - before + 0.5, np.pi), 1.5, atol=1e-6)


def test_published_widths_are_150_px_of_the_network_s_image(files: dict[str, Path | None]) -> None:
    weights = load_weights("ggcnn", files["ggcnn"])
    for head, value in (("pos", 0.8), ("cos", -1.0), ("sin", 0.0), ("width", 0.2)):
        layer = getattr(weights.network, f"{head}_output")
        torch.nn.init.zeros_(layer.weight)
        torch.nn.init.constant_(layer.bias, value)
    maps = NetworkDetector(weights).predict(frame())
    assert maps.quality.shape == (300, 300)
    assert np.allclose(maps.quality, 0.8, atol=1e-5)
    assert np.allclose(maps.width, 30.0, atol=1e-3)
    assert np.allclose(np.abs(maps.angle), np.pi / 2, atol=1e-5)


def test_angles_lie_in_the_half_open_half_turn() -> None:
    rng = np.random.default_rng(0)
    heads = rng.normal(size=(4, 32, 32)).astype(np.float32)
    heads[1, :4], heads[2, :4] = -1.0, 0.0  # doubled angle of exactly half a turn
    raw = replace(NetworkDetectorConfig(), quality_sigma=0, angle_sigma=0, width_sigma=0)
    _, angle, _ = postprocess(heads, 1.0, raw)
    assert np.allclose(angle, wrap_half_pi(np.arctan2(heads[2], heads[1]) / 2), atol=1e-6)


@pytest.mark.parametrize("runtime", ["torch", "openvino"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30])
@pytest.mark.parametrize("head", ["pos", "cos", "width"])
def test_a_network_gone_wrong_finds_nothing(value: float, head: str, runtime: str) -> None:
    weights = random_weights("ggcnn2", {})
    torch.nn.init.constant_(getattr(weights.network, f"{head}_output").bias, value)
    maps = NetworkDetector(weights, runtime=runtime).predict(frame())
    assert not maps.quality.any()
    assert np.isfinite(maps.width).all()


@pytest.mark.parametrize("modality", ["rgb", "rgbd"])
@pytest.mark.parametrize("runtime", ["torch", "openvino"])
def test_a_network_that_reads_colour_sees_it_and_says_when_there_is_none(modality: str, runtime: str) -> None:
    torch.manual_seed(0)
    detector = NetworkDetector(random_weights("ggcnn2", {}, NetworkInput(modality=modality)), runtime=runtime)
    assert reads_colour(detector)
    with pytest.raises(ConfigError, match=rf"{modality}.*colour.*WristCamera\(colour=True\)"):
        detector.predict(frame())
    colours = np.random.default_rng(0).integers(0, 256, (2, 480, 640, 3), dtype=np.uint8)
    first, second = (detector.predict(replace(frame(), rgb=rgb)) for rgb in colours)
    assert not np.array_equal(first.angle, second.angle)


def test_a_network_that_claims_no_opening_opens_the_hand_fully_wherever_the_camera_is() -> None:
    detector = NetworkDetector.load("pinto", runtime="torch")
    for nearer in (0.0, 0.15):
        seen = frame()
        found = detector.predict(replace(seen, depth=seen.depth - np.float32(nearer)))
        opening_m = found.width * found.depth / found.intrinsics.fx
        assert np.allclose(opening_m, GRIPPER_MAX_WIDTH, rtol=1e-5)
