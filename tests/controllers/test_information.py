from __future__ import annotations

import math

import numpy as np
import pytest
from toy_views import flat_map

from mpgrasp.controllers.grid_map import GridConfig, GridMap
from mpgrasp.controllers.information import (
    cell_entropy,
    exploration_cost,
    grid_entropy,
    information_gain,
    utility,
)
from mpgrasp.geometry import looking_down


def test_entropy_is_zero_for_one_full_bin() -> None:
    for n in (1, 7, 4000):
        assert cell_entropy(np.eye(10) * n) == pytest.approx(np.zeros(10), abs=1e-12)


def test_entropy_is_log_n_for_a_uniform_histogram_of_any_size() -> None:
    for n in (0.5, 1, 300):
        assert cell_entropy(np.full(10, n)) == pytest.approx(math.log(10))


def test_an_empty_histogram_is_maximally_uncertain_with_and_without_prior() -> None:
    empty = np.zeros((2, 3, 10), np.float32)
    for prior in (0.0, 1e-6, 18.0):
        np.testing.assert_allclose(cell_entropy(empty, prior), math.log(10), rtol=1e-6)


def test_whole_counts_have_the_entropy_of_the_same_numbers_as_fractions() -> None:
    counts = np.array([[3, 0, 1], [0, 0, 5]])
    for prior in (0.0, 2.0, 0.5):
        np.testing.assert_allclose(cell_entropy(counts, prior), cell_entropy(counts.astype(float), prior))


def test_nothing_is_less_uncertain_than_certain_and_an_empty_cell_divides_by_nothing() -> None:
    counts = np.concatenate([np.eye(10) * n for n in (1, 3, 7, 49, 4099)] + [np.zeros((1, 10))])
    with np.errstate(all="raise"):
        assert (cell_entropy(counts.astype(np.float32)) >= 0).all()


def test_entropy_agrees_with_the_sum_written_out() -> None:
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 20, (4, 5, 10)).astype(np.float32)
    for cell in np.ndindex(4, 5):
        p = [c / counts[cell].sum() for c in counts[cell]]
        expected = -sum(v * math.log(v) for v in p if v > 0)
        assert cell_entropy(counts)[cell] == pytest.approx(expected, rel=1e-5)


def test_entropy_changes_with_a_count_as_its_derivative_says() -> None:
    """dH/dq_i = -(log p_i + H) / S, by finite differences."""
    counts = np.array([3.0, 8.0, 1.0, 5.0, 2.0])
    H, S = cell_entropy(counts), counts.sum()
    for i in range(5):
        step = np.zeros(5)
        step[i] = 1e-5
        slope = (cell_entropy(counts + step) - cell_entropy(counts - step)) / 2e-5
        assert slope == pytest.approx(-(math.log(counts[i] / S) + H) / S, rel=1e-5)


def test_looking_at_a_cell_makes_it_less_uncertain_and_leaves_the_unseen_at_the_maximum() -> None:
    grid = GridMap()
    view = flat_map(0.03, looking_down([0.5, 0.0, 0.4]))
    last = grid_entropy(grid)
    np.testing.assert_allclose(last, math.log(10), rtol=1e-6)
    for _ in range(4):
        grid.update(view)
        entropy = grid_entropy(grid)
        seen = grid.observations() > 0
        assert (entropy[seen] < last[seen]).all()
        np.testing.assert_allclose(entropy[~seen], math.log(10), rtol=1e-6)
        last = entropy


def test_the_prior_counts_once_per_angle_and_quality_bin() -> None:
    grid = GridMap(GridConfig(extent=0.1, cell=0.05, prior_count=2.0))
    grid.quality_counts[0, 0, 0] = 30
    p = np.full(10, 2.0 * 18)
    p[0] += 30
    p /= p.sum()
    assert grid_entropy(grid)[0, 0] == pytest.approx(-(p * np.log(p)).sum(), rel=1e-5)


def test_gain_of_a_uniform_map_is_its_entropy_inside_at_any_footprint() -> None:
    """The weights sum to one, so that the exploration cost weighs the same at every height."""
    for sigma in (1.0, 4.0, 9.5):
        gain = information_gain(np.full((81, 81), 1.7), sigma)
        assert gain[40, 40] == pytest.approx(1.7, rel=1e-5)
        np.testing.assert_allclose(information_gain(np.full((81, 81), 1.7), sigma, "mirror"), 1.7, rtol=1e-5)


def test_gain_agrees_with_the_weighted_sum_written_out_on_a_non_square_grid() -> None:
    rng = np.random.default_rng(1)
    entropy, sigma = rng.random((12, 19)), 2.3
    radius = math.ceil(3 * sigma)
    offsets = range(-radius, radius + 1)
    total = sum(math.exp(-0.5 * (i**2 + j**2) / sigma**2) for i in offsets for j in offsets)
    gain = information_gain(entropy, sigma)
    for row, col in [(0, 0), (6, 9), (11, 3), (5, 18)]:
        expected = sum(
            math.exp(-0.5 * (i**2 + j**2) / sigma**2) / total * entropy[row + i, col + j]
            for i in offsets
            for j in offsets
            if 0 <= row + i < 12 and 0 <= col + j < 19
        )
        assert gain[row, col] == pytest.approx(expected, rel=1e-5)


def test_beyond_the_border_nothing_is_gained_unless_mirrored() -> None:
    entropy = np.ones((40, 40))
    gain = information_gain(entropy, 5.0)
    assert gain[0, 20] == pytest.approx(0.5, abs=0.05)
    assert gain[0, 0] == pytest.approx(0.25, abs=0.05)
    assert information_gain(entropy, 5.0, "mirror")[0, 0] == pytest.approx(1.0, rel=1e-5)


def test_a_footprint_wider_than_the_grid_is_served_by_both_borders() -> None:
    entropy = np.random.default_rng(2).random((7, 9))
    for border in ("nothing", "mirror"):
        gain = information_gain(entropy, 30.0, border)
        assert gain.shape == (7, 9)
        assert np.isfinite(gain).all()


def test_cost_is_the_distance_to_the_best_cell_and_grows_on_the_way_down() -> None:
    grid = GridMap(GridConfig(extent=0.1))
    best = grid.position((4, 13))
    for fraction, factor in ((1.0, 0.0), (0.5, 0.5), (0.0, 1.0), (-0.2, 1.0), (1.4, 0.0)):
        cost = exploration_cost(grid, best, fraction)
        assert cost[4, 13] == 0
        assert cost[4, 3] == pytest.approx(factor * 10 * 0.005)
        assert cost[7, 17] == pytest.approx(factor * 5 * 0.005)
    assert not exploration_cost(grid, None, 0.0).any()


def test_utility_loses_gamma_per_metre_of_cost() -> None:
    gain, cost = np.full((2, 2), 1.5), np.array([[0.0, 0.1], [0.2, 0.3]])
    np.testing.assert_allclose(utility(gain, cost, 2.0), [[1.5, 1.3], [1.1, 0.9]])
