"""The contract that every detector keeps: what it may be fed, and what comes back."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from height_maps import Solid, height_map
from safetensors.torch import save_file

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors import DETECTORS, make_detector
from mpgrasp.detectors.detector import GraspDetector, prepare, reads_colour
from mpgrasp.detectors.network_detector import NetworkDetector, NetworkDetectorConfig, postprocess
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.detectors.networks.weights import NetworkWeights, load_weights, save_weights
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.geometry import FloatArray, looking_down, wrap_half_pi
from mpgrasp.height_map import HeightMap

INTRINSICS = CameraIntrinsics(fx=385.0, fy=385.0, cx=319.5, cy=239.5, width=640, height=480)
STICK = Solid(x=0.52, y=-0.03, yaw=0.3, length=0.08, breadth=0.02, height=0.008)
SMALL = {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1}
IMAGE = NetworkInput(centre="median", scale=20.0)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Compiled networks of these tests are kept, but not in the user's cache."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MPGRASP_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path | None]:
    """Weights of random small networks, a published format among them; None for the oracle."""
    folder = tmp_path_factory.mktemp("weights")
    torch.manual_seed(0)
    made = {"dhrnet": SMALL, "ggcnn2": {}, "fcn": {}}
    for name, settings in made.items():
        save_weights(folder / f"{name}.safetensors", random_weights(name, settings))
    torch.save(build_network("ggcnn", {}).state_dict(), folder / "published.pt")
    return {
        **{name: folder / f"{name}.safetensors" for name in made},
        "ggcnn": folder / "published.pt",
        "oracle": None,
    }


def random_weights(
    name: str, settings: dict[str, Any], image: NetworkInput = IMAGE, channels: int | None = None
) -> NetworkWeights:
    settings = {**settings, "channels": channels or image.channels}
    return NetworkWeights(name=name, network=build_network(name, settings), settings=settings, input=image)


CASES = [
    *((name, runtime) for name in ("dhrnet", "ggcnn2", "ggcnn") for runtime in ("torch", "openvino")),
    ("oracle", "auto"),
]


@pytest.fixture(scope="module")
def made(files: dict[str, Path | None]) -> dict[tuple[str, str], GraspDetector]:
    return {case: make_detector(case[0], files[case[0]], case[1]) for case in CASES}


@pytest.fixture(params=CASES, ids="-".join)
def detector(request: pytest.FixtureRequest, made: dict[tuple[str, str], GraspDetector]) -> GraspDetector:
    found = made[request.param]
    found.reset(height_map(STICK))
    return found


def frame(depth: FloatArray | None = None, T: FloatArray | None = None) -> DepthFrame:
    """A stick on a table, nearly, or that depth."""
    if depth is None:
        v, u = np.indices((480, 640))
        depth = np.where((abs(u - 340) < 12) & (abs(v - 220) < 40), 0.392, 0.4)
        depth = depth + np.random.default_rng(0).normal(0, 5e-4, depth.shape)
    return DepthFrame(
        depth=depth.astype(np.float32),
        intrinsics=replace(INTRINSICS, height=depth.shape[0], width=depth.shape[1]),
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
    first = detector.predict(frame())
    detector.predict(frame(frame().depth[::-1]))
    second = detector.predict(frame())
    for name in ("quality", "angle", "width", "depth"):
        assert np.array_equal(getattr(first, name), getattr(second, name))


def test_the_frame_is_not_changed(detector: GraspDetector) -> None:
    image = frame()
    image.depth[200:260, 300:330] = np.nan
    before = image.depth.copy()
    detector.predict(image)
    assert np.array_equal(image.depth, before, equal_nan=True)


def lone_row() -> FloatArray:
    depth = np.full((480, 640), np.nan)
    depth[240] = np.linspace(0.3, 0.4, 640)
    return depth


def tiny(side: int) -> FloatArray:
    return np.random.default_rng(0).uniform(0.3, 0.4, (side, side))


@pytest.mark.parametrize(
    "depth",
    [
        np.full((480, 640), np.nan),
        np.full((480, 640), np.inf),
        np.full((480, 640), -np.inf),
        np.zeros((480, 640)),
        np.full((480, 640), 0.4),
        np.where(np.arange(640) < 300, 0.4, np.inf) * np.ones((480, 1)),
        lone_row(),
        lone_row()[:, :40],
        tiny(1),
        tiny(2),
        tiny(20),
        tiny(350)[:1],
    ],
    ids=[
        "nan",
        "inf",
        "-inf",
        "zero",
        "constant",
        "half-inf",
        "row",
        "column-of-a-row",
        "1px",
        "2px",
        "20px",
        "one-row-high",
    ],
)
def test_an_image_that_says_nothing_has_no_grasp(depth: FloatArray, detector: GraspDetector) -> None:
    image = frame(depth)
    image.depth.flags.writeable = False
    maps = detector.predict(image)
    assert not maps.quality.any()
    assert np.isfinite(maps.angle).all()
    assert np.isfinite(maps.width).all()
    assert maps.quality.shape == maps.depth.shape


def test_infinite_depths_are_holes_like_any_other(detector: GraspDetector) -> None:
    holed, infinite = frame(), frame()
    hole = np.random.default_rng(1).random(holed.depth.shape) < 0.1
    holed.depth[hole] = np.nan
    infinite.depth[hole] = np.random.default_rng(2).choice([np.inf, -np.inf, 0.0, -1.0], int(hole.sum()))
    first, second = detector.predict(holed), detector.predict(infinite)
    assert np.array_equal(first.quality, second.quality)
    assert np.isfinite(second.depth).all()


def test_small_images_are_used_as_far_as_they_go(detector: GraspDetector) -> None:
    whole = frame()
    window = np.s_[140:300, 240:400]
    small = replace(whole, depth=whole.depth[window], intrinsics=INTRINSICS.crop(140, 240, 160, 160))
    maps = detector.predict(small)
    assert maps.quality.shape == maps.depth.shape
    assert np.isfinite(maps.quality).all()


def test_holes_are_filled_and_do_no_harm(detector: GraspDetector) -> None:
    image = frame()
    image.depth[np.random.default_rng(1).random(image.depth.shape) < 0.2] = np.nan
    image.depth[150:230, 200:230] = np.nan
    maps = detector.predict(image)
    assert np.isfinite(maps.quality).all()
    assert np.isfinite(maps.depth).all()


def test_only_the_oracle_reads_the_truth(files: dict[str, Path | None]) -> None:
    for name in ("dhrnet", "ggcnn2"):
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
    image = NetworkInput(size=64, centre="median", scale=20.0)(depth)
    assert image.shape == (1, 64, 64)
    assert np.allclose(image[0, 40, 40], 0.0)
    assert np.allclose(image[0, 5, 5], -0.08, atol=1e-5)
    published = NetworkInput(size=64)(depth)
    assert np.allclose(published[0], depth - depth.mean(), atol=1e-6)


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


def test_a_network_that_reads_depth_needs_no_colour(made: dict[tuple[str, str], GraspDetector]) -> None:
    assert not any(reads_colour(detector) for detector in made.values())
    detector = made["dhrnet", "torch"]
    coloured = replace(frame(), rgb=np.full((480, 640, 3), 200, np.uint8))
    assert np.array_equal(detector.predict(coloured).quality, detector.predict(frame()).quality)


def test_only_networks_have_something_to_prepare(files: dict[str, Path | None]) -> None:
    assert prepare(make_detector("oracle")) is None
    line = prepare(make_detector("ggcnn2", files["ggcnn2"], "torch"))
    assert line is not None
    assert line.startswith("ggcnn2: torch f32")


def _truncated(good: bytes) -> bytes:
    return good[: len(good) // 2]


def _damaged(good: bytes) -> bytes:
    return b"\xff" * 16 + good[16:-64] + b"\xff" * 64


@pytest.mark.parametrize("name", ["ggcnn2", "ggcnn"], ids=[".safetensors", ".pt"])
@pytest.mark.parametrize(
    "spoil",
    [lambda _: b"", lambda _: b"no weights at all" * 40, _truncated, _damaged],
    ids=["empty", "text", "truncated", "damaged"],
)
def test_broken_weight_files_are_one_clear_error(
    spoil: Callable[[bytes], bytes], name: str, files: dict[str, Path | None], tmp_path: Path
) -> None:
    source = files[name]
    assert source is not None
    broken = tmp_path / f"broken{source.suffix}"
    broken.write_bytes(spoil(source.read_bytes()))
    with pytest.raises(WeightsError):
        make_detector(name, broken)


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_a_wrong_number_of_channels_is_one_clear_error(channels: int, tmp_path: Path) -> None:
    file = tmp_path / "w.safetensors"
    save_weights(file, random_weights("ggcnn2", {}, IMAGE, channels))
    with pytest.raises(WeightsError, match="channels"):
        make_detector("ggcnn2", file)


def test_another_network_s_weights_are_one_clear_error(files: dict[str, Path | None], tmp_path: Path) -> None:
    for name, other in (("dhrnet", "ggcnn2"), ("ggcnn2", "ggcnn"), ("tfgrasp", "dhrnet"), ("unet", "fcn")):
        with pytest.raises(WeightsError):
            make_detector(name, files[other])
    foreign = tmp_path / "foreign.safetensors"
    save_file({"layer.weight": torch.zeros(3, 3)}, foreign)
    with pytest.raises(WeightsError, match="not a weights file of mpgrasp"):
        make_detector("dhrnet", foreign)


def test_a_network_without_shipped_weights_says_how_to_get_some() -> None:
    with pytest.raises(WeightsError, match=r"fcn_residual.*--weights.*training train fcn_residual"):
        make_detector("fcn_residual")


def test_unknown_names_and_settings_are_one_clear_error(
    files: dict[str, Path | None], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=r"unknown detector.*dhrnet, tfgrasp, ggcnn, ggcnn2, .*oracle"):
        make_detector("yolo")
    with pytest.raises(ConfigError, match="no weights"):
        make_detector("oracle", files["dhrnet"])
    with pytest.raises(WeightsError):
        make_detector("dhrnet", tmp_path / "gone.safetensors")
    for name in ("dhrnet", "oracle"):
        with pytest.raises(ConfigError, match=r"unknown runtime; got 'tpu'; allowed: auto, torch, openvino"):
            make_detector(name, files[name], "tpu")
    with pytest.raises(ConfigError, match="detector settings"):
        NetworkDetectorConfig(crop=0)


def test_importing_the_registry_loads_no_torch_and_no_openvino() -> None:
    code = "import sys, mpgrasp.detectors; sys.exit(bool({'torch', 'openvino'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
