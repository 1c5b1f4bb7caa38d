"""The contract that every detector keeps: what it may be fed, and what comes back."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from height_maps import Solid, height_map
from toy_networks import INTRINSICS, frame, weight_files

import mpgrasp
from mpgrasp.controllers.controller import Controller, ControllerExtras
from mpgrasp.detectors import DETECTORS, make_detector
from mpgrasp.detectors.detector import (
    DetectorExtras,
    GraspDetector,
    device_of,
    prepare,
    reads_colour,
    runtime_of,
)
from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.oracle import OracleDetector
from mpgrasp.exceptions import PlugInError
from mpgrasp.geometry import FloatArray
from mpgrasp.height_map import HeightMap

pytestmark = pytest.mark.usefixtures("network_cache")
STICK = Solid(x=0.52, y=-0.03, yaw=0.3, length=0.08, breadth=0.02, height=0.008)
CASES = [
    *((name, runtime) for name in ("dhrnet", "ggcnn2", "ggcnn") for runtime in ("torch", "openvino")),
    ("oracle", "auto"),
]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path | None]:
    return weight_files(tmp_path_factory.mktemp("weights"))


@pytest.fixture(scope="module")
def made(files: dict[str, Path | None]) -> dict[tuple[str, str], GraspDetector]:
    return {case: make_detector(case[0], files[case[0]], case[1]) for case in CASES}


@pytest.fixture(params=CASES, ids="-".join)
def detector(request: pytest.FixtureRequest, made: dict[tuple[str, str], GraspDetector]) -> GraspDetector:
    found = made[request.param]
    found.reset(height_map(STICK))
    return found


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
    image = frame(np.where(np.isfinite(depth) & (depth > 0), depth, np.nan))
    image.depth[:] = depth  # after its check: who writes into a frame is not refused
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


READ = re.compile(r"(?:getattr|hasattr)\((?:self\.)?(detector|controller), \"(\w+)\"")


def test_whatever_is_read_of_a_detector_or_a_controller_is_declared() -> None:
    declared = {
        "detector": {*members(GraspDetector), *members(DetectorExtras)},
        "controller": {*members(Controller), *members(ControllerExtras)},
    }
    files = Path(mpgrasp.__file__).parent.rglob("*.py")
    read = {found for path in files for found in READ.findall(path.read_text(encoding="utf-8"))}
    assert {("detector", "warm_up"), ("controller", "remember_failure")} <= read
    assert not {(who, name) for who, name in read if name not in declared[who]}


def members(protocol: type) -> set[str]:
    return {name for name in (*vars(protocol), *protocol.__annotations__) if name[0] != "_"}


def test_networks_have_all_that_a_detector_may_have(files: dict[str, Path | None]) -> None:
    network = NetworkDetector.load("ggcnn2", files["ggcnn2"], runtime="torch")
    extras: DetectorExtras = network
    assert (runtime_of(network), device_of(network)) == (extras.runtime, extras.device)
    oracle = make_detector("oracle")
    assert runtime_of(oracle) is device_of(oracle) is None


def test_a_detector_that_cannot_get_ready_says_why() -> None:
    class NoEngine(OracleDetector):
        def warm_up(self) -> float:
            raise RuntimeError("no engine")

    with pytest.raises(PlugInError, match="detector oracle cannot get ready: RuntimeError: no engine"):
        prepare(NoEngine())
