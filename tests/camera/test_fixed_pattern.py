"""Laws of the pattern in depth that averaging does not remove."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.camera.fixed_pattern import FixedPattern
from mpgrasp.camera.noise import DepthNoise, apply
from mpgrasp.depth import CameraIntrinsics

SHAPE = (160, 240)
IMAGE = CameraIntrinsics(fx=447.0, fy=447.0, cx=119.5, cy=79.5, width=240, height=160)
WAVES = DepthNoise(fixed_pattern=0.06, pattern_px=6.0, disparity_step=0.0)


def test_averaged_frames_keep_the_pattern_and_lose_the_rest_as_one_over_their_number() -> None:
    pattern = FixedPattern(WAVES, SHAPE, 1.0, np.random.default_rng(1)).at(0.0)
    flat = np.ones(SHAPE, np.float32)
    frames = [apply(flat, IMAGE, np.random.default_rng([2, k]), WAVES, pattern) for k in range(64)]
    per_px = 1.0 / (447 * 0.05)  # dz = z^2 / (f B) of a pixel of disparity, at 1 m
    assert np.std(frames[0]) == pytest.approx(per_px * np.hypot(0.06, 0.08), rel=0.12)
    mean = np.mean(frames, axis=0)
    assert np.std(mean) == pytest.approx(per_px * np.hypot(0.06, 0.08 / 8), rel=0.12)
    assert np.corrcoef(mean.ravel(), -pattern.ravel())[0, 1] > 0.97


def test_the_pattern_has_the_deviation_and_the_correlation_that_are_asked_for() -> None:
    fields = [FixedPattern(WAVES, SHAPE, 1.0, np.random.default_rng([3, k])).at(0.0) for k in range(40)]
    values = np.stack(fields)
    assert values.std() == pytest.approx(0.06, rel=0.05)
    for shift in (3, 6, 12):  # noise blurred by a Gaussian of s is correlated by exp(-d^2 / 4 s^2)
        found = np.mean(values[:, :, shift:] * values[:, :, :-shift]) / values.var()
        assert found == pytest.approx(np.exp(-(shift**2) / (4 * 6.0**2)), abs=0.05)


def test_a_pattern_without_a_time_constant_stands_for_ever() -> None:
    pattern = FixedPattern(WAVES, SHAPE, 1.0, np.random.default_rng(4))
    np.testing.assert_array_equal(pattern.at(0.0), pattern.at(1e4))


def test_over_all_patterns_the_correlation_in_time_is_exponential() -> None:
    slow = DepthNoise(fixed_pattern=0.06, pattern_px=1.0, pattern_time=2.0)
    patterns = [FixedPattern(slow, (24, 24), 1.0, np.random.default_rng([5, k])) for k in range(700)]
    start = np.stack([pattern.at(3.0) for pattern in patterns])
    assert start.std() == pytest.approx(0.06, rel=0.03)
    for later in (0.5, 2.0, 6.0):
        then = np.stack([pattern.at(3.0 + later) for pattern in patterns])
        found = np.mean(start * then) / (start.std() * then.std())
        assert found == pytest.approx(np.exp(-later / 2.0), abs=0.04)


def test_the_pattern_is_a_function_of_time_alone() -> None:
    slow = DepthNoise(fixed_pattern=0.06, pattern_time=2.0)
    one, other = (FixedPattern(slow, SHAPE, 1.0, np.random.default_rng(6)) for _ in range(2))
    one.at(0.1), one.at(9.0)
    np.testing.assert_array_equal(one.at(4.0), other.at(4.0))
