"""The contract that every detector keeps: what it may be fed, and what comes back."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from height_maps import Solid, height_map

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors import DETECTORS, GraspDetector, make_detector
from mpgrasp.detectors.ggcnn import GGCNNConfig, make_ggcnn
from mpgrasp.detectors.network_detector import NetworkDetector, NetworkDetectorConfig
from mpgrasp.detectors.network_input import NetworkInput
from mpgrasp.detectors.weights import NetworkWeights, build_network, load_weights, save_weights
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.height_map import HeightMap

INTRINSICS = CameraIntrinsics(fx=385.0, fy=385.0, cx=319.5, cy=239.5, width=640, height=480)
STICK = Solid(x=0.52, y=-0.03, yaw=0.3, length=0.08, breadth=0.02, height=0.008)
SMALL = {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1, "channels": 2}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path | None]:
    """Weights of random small networks, the published formats among them; None for the oracle."""
    folder = tmp_path_factory.mktemp("weights")
    torch.manual_seed(0)
    image = NetworkInput(centre="median", scale=20.0, range_channel=True)
    for name, settings in (("dhrnet", SMALL), ("ggcnn", {"channels": 2})):
        network = build_network(name, settings)
        save_weights(
            folder / f"{name}.safetensors",
            NetworkWeights(name=name, network=network, settings=settings, input=image),
        )
    torch.save(make_ggcnn(GGCNNConfig(variant=1)).state_dict(), folder / "published.pt")
    return {
        "dhrnet": folder / "dhrnet.safetensors",
        "ggcnn": folder / "ggcnn.safetensors",
        "ggcnn published": folder / "published.pt",
        "oracle": None,
    }


@pytest.fixture(params=["dhrnet", "ggcnn", "ggcnn published", "oracle"])
def detector(request: pytest.FixtureRequest, files: dict[str, Path | None]) -> GraspDetector:
    made = make_detector(request.param.split()[0], files[request.param])
    made.reset(height_map(STICK))
    return made


def frame(depth: FloatArray | None = None, T: FloatArray | None = None) -> DepthFrame:
    """A stick on a table, nearly, or that depth."""
    if depth is None:
        v, u = np.indices((480, 640))
        depth = np.where((abs(u - 340) < 12) & (abs(v - 220) < 40), 0.392, 0.4)
        depth = depth + np.random.default_rng(0).normal(0, 5e-4, depth.shape)
    return DepthFrame(
        depth=depth.astype(np.float32),
        intrinsics=INTRINSICS,
        T_world_camera=looking_down([0.5, 0.0, 0.4]) if T is None else T,
        time=1.5,
    )


def test_every_detector_is_made_by_name(detector: GraspDetector) -> None:
    assert detector.name in DETECTORS


def test_maps_are_finite_and_in_range_and_keep_the_camera(detector: GraspDetector) -> None:
    image = frame()
    maps = detector.predict(image)
    assert maps.quality.dtype == maps.angle.dtype == maps.width.dtype == np.float32
    assert np.isfinite(maps.quality).all()
    assert ((maps.quality >= 0) & (maps.quality <= 1)).all()
    assert ((maps.angle >= -np.pi / 2) & (maps.angle <= np.pi / 2)).all()
    assert (np.isfinite(maps.width) & (maps.width >= 0)).all()
    assert np.isfinite(maps.depth).all()
    assert maps.time == image.time
    assert np.array_equal(maps.T_world_camera, image.T_world_camera)
    # same ray through the same world point, by the frame's own geometry and by the map's
    points = maps.world_points()[10:-10:40, 10:-10:40]
    u, v = np.moveaxis(image.pixels(points), -1, 0)
    assert ((u > 145) & (u < 495) & (v > 65) & (v < 415)).all()


def test_the_same_frame_gives_the_same_map(detector: GraspDetector) -> None:
    first, second = detector.predict(frame()), detector.predict(frame())
    for name in ("quality", "angle", "width", "depth"):
        assert np.array_equal(getattr(first, name), getattr(second, name))


def test_the_frame_is_not_changed(detector: GraspDetector) -> None:
    image = frame()
    image.depth[200:260, 300:330] = np.nan
    before = image.depth.copy()
    detector.predict(image)
    assert np.array_equal(image.depth, before, equal_nan=True)


@pytest.mark.parametrize("depth", [np.nan, 0.4], ids=["no return at all", "constant"])
def test_an_image_that_says_nothing_has_no_grasp(depth: float, detector: GraspDetector) -> None:
    detector.reset(height_map())
    maps = detector.predict(frame(np.full((480, 640), depth)))
    assert not maps.quality.any()
    assert maps.quality.shape == maps.depth.shape


def test_a_few_stray_returns_are_nothing(detector: GraspDetector) -> None:
    detector.reset(height_map())
    depth = np.full((480, 640), np.nan)
    depth[240, 300:320] = np.linspace(0.3, 0.4, 20)
    assert not detector.predict(frame(depth)).quality.any()


def test_holes_are_filled_and_do_no_harm(detector: GraspDetector) -> None:
    image = frame()
    image.depth[np.random.default_rng(1).random(image.depth.shape) < 0.2] = np.nan
    image.depth[150:230, 200:230] = np.nan
    maps = detector.predict(image)
    assert np.isfinite(maps.quality).all()
    assert np.isfinite(maps.depth).all()


def test_only_the_oracle_reads_the_truth(files: dict[str, Path | None]) -> None:
    for name in ("dhrnet", "ggcnn"):
        made = make_detector(name, files[name])
        empty: HeightMap = height_map()
        made.reset(height_map(STICK))
        first = made.predict(frame())
        made.reset(empty)
        assert np.array_equal(first.quality, made.predict(frame()).quality)


def test_turning_the_scene_s_frame_turns_nothing_in_the_image(files: dict[str, Path | None]) -> None:
    made = make_detector("dhrnet", files["dhrnet"])
    first = made.predict(frame())
    turned = made.predict(frame(T=looking_down([0.5, 0.0, 0.4], 1.0)))
    assert np.array_equal(first.angle, turned.angle)
    assert np.allclose(np.mod(turned.world_angle() - first.world_angle() + 0.5, np.pi), 1.5, atol=1e-6)


def test_median_input_puts_the_table_at_zero_and_scales_heights() -> None:
    depth = np.full((64, 64), 0.5, np.float32)
    depth[:20, :20] = 0.496
    image = NetworkInput(size=64, centre="median", scale=20.0, range_channel=True)(depth)
    assert image.shape == (2, 64, 64)
    assert np.allclose(image[0, 40, 40], 0.0)
    assert np.allclose(image[0, 5, 5], -0.08, atol=1e-5)
    assert np.ptp(image[1]) == 0
    published = NetworkInput(size=64)(depth)
    assert published.shape == (1, 64, 64)
    assert np.allclose(published[0], depth - depth.mean(), atol=1e-6)


def test_published_widths_are_150_px_of_the_network_s_image(files: dict[str, Path | None]) -> None:
    weights = load_weights("ggcnn", files["ggcnn published"])
    for head, value in (("pos", 0.8), ("cos", -1.0), ("sin", 0.0), ("width", 0.2)):
        layer = getattr(weights.network, f"{head}_output")
        torch.nn.init.zeros_(layer.weight)
        torch.nn.init.constant_(layer.bias, value)
    maps = NetworkDetector(weights).predict(frame())
    assert maps.quality.shape == (300, 300)
    assert np.allclose(maps.quality, 0.8, atol=1e-5)
    assert np.allclose(maps.width, 30.0, atol=1e-3)
    assert np.allclose(np.abs(maps.angle), np.pi / 2, atol=1e-5)


def test_folding_batch_norms_leaves_the_function_alone(files: dict[str, Path | None]) -> None:
    weights = load_weights("dhrnet", files["dhrnet"])
    generator = torch.Generator().manual_seed(1)
    for module in weights.network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean = torch.randn(module.num_features, generator=generator)
            module.running_var = torch.rand(module.num_features, generator=generator) + 0.5
    folded = NetworkDetector(weights)
    image = np.random.default_rng(0).normal(size=(2, 224, 224)).astype(np.float32)
    with torch.inference_mode():
        plain = torch.cat(weights.network(torch.from_numpy(image)[None]), dim=1)[0].numpy()
    assert np.allclose(folded._heads(image), plain, atol=1e-4 * np.abs(plain).max())


def test_unknown_names_and_settings_are_one_clear_error(
    files: dict[str, Path | None], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=r"unknown detector.*dhrnet, ggcnn, oracle"):
        make_detector("yolo")
    with pytest.raises(ConfigError, match="no weights"):
        make_detector("oracle", files["dhrnet"])
    with pytest.raises(WeightsError):
        make_detector("dhrnet", tmp_path / "gone.safetensors")
    with pytest.raises(ConfigError, match="precision"):
        dataclasses.replace(NetworkDetectorConfig(), precision="int3")


def test_importing_the_registry_loads_no_torch() -> None:
    code = "import sys, mpgrasp.detectors; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
