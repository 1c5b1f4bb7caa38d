"""Laws of what a network reads: depth before colour, heights scaled, the table at zero."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.exceptions import ConfigError


def test_inputs_have_depth_before_colour_and_colour_without_its_mean() -> None:
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.3, 0.5, (40, 50)).astype(np.float32)
    rgb = rng.integers(0, 256, (40, 50, 3), dtype=np.uint8)
    d, c, dc = (NetworkInput(modality=m)(depth, rgb) for m in ("d", "rgb", "rgbd"))
    assert np.array_equal(dc, np.concatenate([d, c]))
    expected = rgb / 255 - (rgb / 255).mean(axis=(0, 1))
    assert np.allclose(c, expected.transpose(2, 0, 1), atol=1e-6)
    assert np.allclose(d[0], depth - depth.mean(), atol=1e-6)
    assert [NetworkInput(modality=m).channels for m in ("d", "rgb", "rgbd")] == [1, 3, 4]
    for wrong in (None, rgb[:30]):
        with pytest.raises(ConfigError, match="colour"):
            NetworkInput(modality="rgbd")(depth, wrong)
    with pytest.raises(ConfigError, match="modality"):
        NetworkInput(modality="bgr")


def test_files_from_before_colour_still_tell_their_input() -> None:
    old = {"size": 224, "centre": "median", "clip": 1.0, "scale": 20.0, "range_channel": False}
    assert NetworkInput(**old) == NetworkInput(centre="median", scale=20.0)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="range"):
        NetworkInput(**{**old, "range_channel": True})  # type: ignore[arg-type]


def test_median_input_puts_the_table_at_zero_and_scales_heights() -> None:
    depth = np.full((64, 64), 0.5, np.float32)
    depth[:20, :20] = 0.496
    image = NetworkInput(size=64, centre="median", scale=20.0)(depth)
    assert image.shape == (1, 64, 64)
    assert np.allclose(image[0, 40, 40], 0.0)
    assert np.allclose(image[0, 5, 5], -0.08, atol=1e-5)
    published = NetworkInput(size=64)(depth)
    assert np.allclose(published[0], depth - depth.mean(), atol=1e-6)
