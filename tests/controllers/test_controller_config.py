"""Laws of the controllers' settings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mpgrasp.controllers.config import MppcConfig
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
        {"yaw_range": 0.5},
        {"peak_threshold": -0.1},
        {"window": 0.0},
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        MppcConfig(**settings)


def test_the_defaults_are_those_of_table_one() -> None:
    c = MppcConfig()
    assert (c.grid.cell, c.grid.extent, c.grid.n_quality, c.grid.n_angle) == (0.005, 0.68, 10, 18)
    assert (c.v_z, c.alpha, c.z_max, c.z_min) == (0.05, 0.2, 0.50, 0.175)


def test_the_threshold_of_a_peak_is_that_of_detection() -> None:
    assert MppcConfig().peak_threshold == PEAK_QUALITY == 0.34
