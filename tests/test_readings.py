"""A frame holds metres and says what it got; cameras' own units and marks are taken where they are told."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.readings import MAX_DEPTH, metres

K = CameraIntrinsics(fx=60.0, fy=63.0, cx=40.2, cy=29.1, width=8, height=6)
POSE = looking_down([0.4, 0.1, 0.5], 0.3)
TRUE = np.linspace(0.25, 0.6, 48).reshape(6, 8).round(3)
HOLES = np.indices((6, 8)).sum(axis=0) % 5 == 0


def frame(depth: Any, **changes: Any) -> DepthFrame:
    return DepthFrame(**{"depth": depth, "intrinsics": K, "T_world_camera": POSE, **changes})


def as_delivered(dtype: type, unit: float, mark: float) -> np.ndarray:
    return np.where(HOLES, mark, TRUE / unit).round(6).astype(dtype)


CAMERAS: dict[str, tuple[np.ndarray, float, Any]] = {
    "realsense-d400": (as_delivered(np.uint16, 0.001, 0), 0.001, 0),
    "realsense-l515": (as_delivered(np.uint16, 0.00025, 0), 0.00025, 0),
    "azure-kinect": (as_delivered(np.uint16, 0.001, 0), 0.001, 0),
    "ros-16uc1": (as_delivered(np.uint16, 0.001, 0), 0.001, 0),
    "ros-32fc1": (as_delivered(np.float32, 1.0, np.nan), 1.0, (np.nan, np.inf, -np.inf)),
    "ros-32fc1-too-far": (as_delivered(np.float32, 1.0, np.inf), 1.0, (np.nan, np.inf, -np.inf)),
    "ros-32fc1-too-near": (as_delivered(np.float32, 1.0, -np.inf), 1.0, (np.nan, np.inf, -np.inf)),
    "zivid": (as_delivered(np.float32, 0.001, np.nan), 0.001, np.nan),
    "highest-reading": (as_delivered(np.uint16, 0.001, 65535), 0.001, (0, 65535)),
    "32-bit-integers": (as_delivered(np.int32, 1e-6, -1), 1e-6, -1),
    "doubles": (as_delivered(np.float64, 1.0, 0.0), 1.0, 0.0),
}


@pytest.mark.parametrize(("depth", "unit", "no_return"), CAMERAS.values(), ids=CAMERAS)
def test_the_fields_cameras_all_give_one_and_the_same_frame(
    depth: np.ndarray, unit: float, no_return: Any
) -> None:
    before = depth.copy()
    made = DepthFrame.from_camera(
        depth, intrinsics=K, T_world_camera=POSE, unit=unit, no_return=no_return, time=2.0
    )
    assert made.depth.dtype == np.float32
    assert made.time == 2.0
    np.testing.assert_array_equal(np.isnan(made.depth), HOLES)
    np.testing.assert_allclose(made.depth[~HOLES], TRUE[~HOLES], rtol=1e-6)
    np.testing.assert_array_equal(depth, before)


def test_metres_in_single_precision_keep_their_bits() -> None:
    depth = np.random.default_rng(0).uniform(0.2, 0.7, (6, 8)).astype(np.float32)
    np.testing.assert_array_equal(metres(depth, 1.0, ()), depth)


def test_a_few_readings_beyond_reach_are_false_matches_and_no_returns() -> None:
    depth = np.full((6, 8), 450, np.uint16)
    depth[0, :3] = 40_000
    made = metres(depth, 0.001, 0)
    assert np.isnan(made[0, :3]).all()
    np.testing.assert_allclose(made[1:], 0.45, rtol=1e-6)


@pytest.mark.parametrize("nothing", [np.zeros((6, 8), np.uint16), np.full((6, 8), np.nan, np.float32)])
def test_an_image_without_any_return_is_allowed(nothing: np.ndarray) -> None:
    unit = 0.001 if nothing.dtype == np.uint16 else 1.0
    made = DepthFrame.from_camera(nothing, intrinsics=K, T_world_camera=POSE, unit=unit, no_return=0)
    assert np.isnan(made.depth).all()
    assert np.isnan(frame(np.full((6, 8), np.nan, np.float32)).depth).all()


def filled(value: float, dtype: type = np.float32) -> np.ndarray:
    return np.full((6, 8), value, dtype)


def with_one(value: float) -> FloatArray:
    depth = filled(0.4)
    depth[2, 3] = value
    return depth


WRONG: dict[str, tuple[Any, str]] = {
    "millimetres": (filled(447.0), r"447 m, which looks like millimetres; got 'float32 \(6, 8\) from 447 to"),
    "one-beyond-reach": (with_one(MAX_DEPTH + 0.1), "looks like millimetres"),
    "uint16": (
        filled(447, np.uint16),
        r"wrong type; got 'uint16 \(6, 8\) from 447 to 447'; allowed: float32",
    ),
    "float64": (filled(0.4, np.float64), "wrong type; got 'float64"),
    "float16": (filled(0.4, np.float16), "wrong type; got 'float16"),
    "bool": (filled(True, np.bool_), "wrong type; got 'bool"),
    "text": (filled(0, np.str_), "wrong type; got '<U"),
    "zero": (filled(0.0), r"0 m, which many cameras report.*no_return"),
    "one-zero": (with_one(0.0), r"0 m, which many cameras report.*from 0 to 0\.4"),
    "negative": (with_one(-0.1), "below zero"),
    "infinite": (with_one(np.inf), "infinite.*no_return"),
    "minus-infinite": (with_one(-np.inf), "below zero.*from -inf"),
    "kilometres": (filled(0.0004), "unit is too small"),
    "list": ([[0.4] * 8] * 6, "no numpy array; got 'list'"),
    "none": (None, "no numpy array; got 'NoneType'"),
    "transposed": (filled(0.4).T, r"disagree in size; got \(8, 6\); allowed: \(H, W\) = \(6, 8\)"),
    "colour": (np.zeros((6, 8, 3), np.float32), "disagree in size"),
}


@pytest.mark.parametrize(("depth", "said"), WRONG.values(), ids=WRONG)
def test_what_is_no_depth_in_metres_is_refused_by_name(depth: Any, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        frame(depth)
    if depth is not None and not isinstance(depth, list) and depth.shape == (6, 8):
        with pytest.raises(ConfigError, match=said):
            replace(frame(filled(0.4)), depth=depth)


MISREAD: dict[str, tuple[Any, Any, Any, str]] = {
    "whole-metres": (filled(447, np.uint16), 1, 0, r"unit of uint16 readings \[m\]; got 1; allowed: 0\.001"),
    "millimetres-as-metres": (filled(447.0), 1.0, 0, r"looks like millimetres.*unit 1 m"),
    "metres-as-millimetres": (filled(0.45), 0.001, 0, r"unit is too small"),
    "zero-not-told": (with_one(0.0), 1.0, np.nan, r"0 m, which many cameras.*no_return"),
    "infinity-not-told": (with_one(np.inf), 1.0, 0, "infinite"),
    "below-zero": (with_one(-1.0), 1.0, 0, "below zero"),
    "a-picture": (filled(90, np.uint8), 0.001, 0, "wrong type; got 'uint8"),
    "bool": (filled(True, np.bool_), 0.001, 0, "wrong type; got 'bool"),
    "complex": (filled(1, np.complex64), 1.0, 0, "wrong type"),
    "three-channels": (np.ones((6, 8, 3), np.uint16), 0.001, 0, "no depth image"),
    "empty": (np.ones((0, 8), np.uint16), 0.001, 0, "no depth image"),
    "list": ([[1]], 0.001, 0, "no depth image; got 'list'"),
    "unit-nan": (filled(450, np.uint16), np.nan, 0, "unusable unit"),
    "unit-negative": (filled(450, np.uint16), -0.001, 0, "unusable unit"),
    "unit-text": (filled(450, np.uint16), "mm", 0, "unusable unit"),
    "unit-thousand": (filled(0.45), 1000.0, 0, "unusable unit"),
    "mark-text": (filled(450, np.uint16), 0.001, "zero", "marks of no return"),
    "mark-none": (filled(450, np.uint16), 0.001, None, "marks of no return"),
}


@pytest.mark.parametrize(("depth", "unit", "no_return", "said"), MISREAD.values(), ids=MISREAD)
def test_readings_that_do_not_fit_what_is_told_of_them_are_refused(
    depth: Any, unit: Any, no_return: Any, said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        DepthFrame.from_camera(depth, intrinsics=K, T_world_camera=POSE, unit=unit, no_return=no_return)


@pytest.mark.parametrize(
    "rgb",
    [
        np.zeros((6, 8, 3), np.float32),
        np.zeros((6, 8, 4), np.uint8),
        np.zeros((6, 8), np.uint8),
        np.zeros((8, 6, 3), np.uint8),
        "red",
    ],
)
def test_colour_of_another_type_or_size_is_refused(rgb: Any) -> None:
    with pytest.raises(ConfigError, match=re.escape("uint8 (H, W, 3) = (6, 8, 3)")):
        frame(filled(0.4), rgb=rgb)
    assert frame(filled(0.4), rgb=np.zeros((6, 8, 3), np.uint8)).rgb is not None


@pytest.mark.parametrize("time", [np.nan, np.inf, None, "now"])
def test_a_time_is_a_finite_number(time: Any) -> None:
    with pytest.raises(ConfigError, match="time"):
        frame(filled(0.4), time=time)
    assert frame(filled(0.4), time=np.float32(3)).time == 3


def test_intrinsics_belong_to_a_frame() -> None:
    with pytest.raises(ConfigError, match="no camera intrinsics"):
        frame(filled(0.4), intrinsics=(60.0, 63.0, 40.2, 29.1))


@pytest.mark.parametrize(
    "changes",
    [
        {"fx": 0.0},
        {"fx": -385.0},
        {"fy": np.nan},
        {"fx": np.inf},
        {"cx": np.nan},
        {"cy": -np.inf},
        {"cx": "middle"},
        {"width": 0},
        {"height": -1},
        {"width": 8.0},
        {"height": "6"},
    ],
    ids=str,
)
def test_intrinsics_that_no_camera_has_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="unusable camera intrinsics"):
        replace(K, **changes)
    assert replace(K, width=np.int64(8), fx=np.float32(60)).width == 8  # type: ignore[arg-type]
