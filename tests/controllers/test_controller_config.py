"""Laws of the controllers' settings."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpgrasp.controllers.config import MPPC, MPPC_ROBUST, MVP, MVP_ROBUST, ReachConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import PEAK_QUALITY


@pytest.mark.parametrize(
    "settings",
    [
        {"v_z": 0.0},
        {"v_1": -0.1},
        {"alpha": 1.5},
        {"gamma": np.nan},
        {"z_min": 0.6},
        {"border": "torus"},
        {"choice": "coin"},
        {"descent": "free fall"},
        {"z_min": -0.1},
        {"cost_heights": (0.5, 0.4)},
        {"cost_heights": (-0.1, 0.4)},
        {"cost_heights": (0.4, float("inf"))},
        {"yaw_range": 0.5},
        {"yaw_range": 1.5},
        {"yaw_range": 3.2},
        {"peak_threshold": -0.1},
        {"window": 0.0},
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        ReachConfig(**settings)


@pytest.mark.parametrize("c", [MVP, MPPC, MVP_ROBUST, MPPC_ROBUST])
def test_what_table_one_says_is_common_to_all(c: ReachConfig) -> None:
    assert (c.grid.cell, c.grid.extent, c.grid.n_quality, c.grid.n_angle) == (0.005, 0.68, 10, 18)
    assert (c.v_z, c.z_max, c.z_min, c.descent) == (0.05, 0.50, 0.175, "constant")


def test_algorithm_one_differs_from_multi_view_picking_in_attenuation_and_in_its_pool_alone() -> None:
    assert replace(MPPC, alpha=1.0, choice="grid") == MVP
    assert (MPPC.alpha, MPPC.choice) == (0.2, "pool")


def test_the_robust_ones_differ_in_attenuation_alone() -> None:
    assert replace(MPPC_ROBUST, alpha=1.0) == MVP_ROBUST
    assert MPPC_ROBUST.alpha == 0.2


def test_the_robust_ones_pay_six_times_the_published_cost() -> None:
    assert MVP_ROBUST.gamma == pytest.approx(6 * MVP.gamma)


def test_settings_cannot_be_changed_by_whoever_reads_them() -> None:
    with pytest.raises(AttributeError):
        MVP.gamma = 1.0  # type: ignore[misc]


def test_the_published_cost_is_a_fifth_of_a_nat_for_every_fifteen_centimetres() -> None:
    assert MVP.gamma * 0.15 == pytest.approx(0.2)


def test_the_threshold_of_a_peak_is_that_of_detection() -> None:
    assert ReachConfig().peak_threshold == PEAK_QUALITY == 0.68
