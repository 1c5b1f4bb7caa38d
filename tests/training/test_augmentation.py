"""Laws of augmentation: labels move with their images."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from toy_training import toy_sample

from mpgrasp.geometry import line_angle_difference
from mpgrasp.training.augmentation import Augmentation, Sample, augment, warp


def bar_s_closing_direction(sample: Sample) -> float:
    """From the labelled pixels' second moments: across the bar's long axis."""
    rows, cols = np.nonzero(sample.quality * sample.valid > 0)
    _, axes = np.linalg.eigh(np.cov(cols, -rows))
    return float(np.arctan2(axes[1, 0], axes[0, 0]))  # the shorter axis, counter-clockwise on screen


@pytest.mark.parametrize("seed", range(12))
def test_augmented_angles_still_point_across_the_bar(seed: int) -> None:
    moved = augment(toy_sample(seed), Augmentation(warp_probability=1.0), np.random.default_rng(seed))
    labelled = (moved.quality > 0) & moved.valid
    across = bar_s_closing_direction(moved)
    assert line_angle_difference(moved.angle[labelled], across).max() < np.deg2rad(6)


@pytest.mark.parametrize("zoom", [0.8, 1.3])
def test_zoom_scales_widths_and_keeps_heights(zoom: float) -> None:
    sample = toy_sample(3)
    moved = warp(sample, 0.2, zoom)
    labelled = (moved.quality > 0) & moved.valid
    assert labelled.sum() == pytest.approx((sample.quality > 0).sum() * zoom**2, rel=0.15)
    assert np.allclose(moved.width[labelled], sample.width.max() * zoom)
    assert np.median(moved.depth) == pytest.approx(np.median(sample.depth) / zoom, abs=2e-3)
    before = np.median(sample.depth[sample.quality > 0]) - np.median(sample.depth)
    after = np.median(moved.depth[labelled]) - np.median(moved.depth[moved.valid])
    assert after == pytest.approx(before, abs=2e-3)


@pytest.mark.parametrize("seed", range(6))
def test_colour_moves_with_depth_and_labels(seed: int) -> None:
    sample = toy_sample(seed)
    bar = (sample.quality > 0).astype(np.uint8) * 200
    painted = dataclasses.replace(sample, rgb=np.dstack([bar] * 3))
    still = Augmentation(brightness=0, contrast=0, cast=0, warp_probability=1.0)
    moved = augment(painted, still, np.random.default_rng(seed))
    assert moved.rgb is not None
    assert np.array_equal(moved.rgb[..., 0] > 100, moved.quality > 0)
    # colour changes neither the draws nor what they do
    plain = augment(sample, still, np.random.default_rng(seed))
    assert np.array_equal(plain.depth, moved.depth)
    recoloured = augment(painted, Augmentation(warp_probability=1.0), np.random.default_rng(seed))
    assert recoloured.rgb is not None
    assert np.array_equal(recoloured.depth, moved.depth)
    assert not np.array_equal(recoloured.rgb, moved.rgb)


@pytest.mark.parametrize("size", [48, 96])
def test_a_resized_sample_shows_the_same_scene_at_other_pixels(size: int) -> None:
    sample = toy_sample(2)
    other = sample.resized(size)
    scale = size / 64
    assert other.depth.shape == (size, size)
    assert other.width.max() == pytest.approx(sample.width.max() * scale)
    for axis in range(2):
        before = np.argwhere(sample.quality > 0)[:, axis].mean() + 0.5
        after = np.argwhere(other.quality > 0)[:, axis].mean() + 0.5
        assert after == pytest.approx(before * scale, abs=0.5)
    assert set(np.unique(other.angle)) <= set(np.unique(sample.angle))


def test_quarter_turns_of_a_label_bring_it_back() -> None:
    sample = toy_sample(1)
    back = sample
    for _ in range(4):
        back = warp(back, np.pi / 2, 1.0)
    assert np.array_equal(back.quality, sample.quality)
    labelled = sample.quality > 0
    assert line_angle_difference(back.angle[labelled], sample.angle[labelled]).max() < 1e-5
