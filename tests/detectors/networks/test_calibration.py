"""Laws of calibration: claims become probabilities, and no pixel overtakes another."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit, logit

from mpgrasp.detectors.networks.calibration import LEAST, Calibration
from mpgrasp.exceptions import ConfigError

SOME = [
    Calibration(slope=1.3, shift=0.7),
    Calibration(slope=0.4, shift=-2.0),
    Calibration(slope=3.0, shift=4.0),
]


@pytest.mark.parametrize("calibration", SOME)
def test_log_odds_are_scaled_and_shifted(calibration: Calibration) -> None:
    claimed = np.linspace(0.001, 0.999, 500)
    expected = expit(calibration.slope * logit(claimed) + calibration.shift)
    np.testing.assert_allclose(calibration(claimed.astype(np.float32)), expected, atol=2e-6)


def test_slope_one_and_no_shift_change_nothing() -> None:
    claimed = np.linspace(0, 1, 101, dtype=np.float32)
    np.testing.assert_allclose(Calibration(slope=1, shift=0)(claimed), claimed, atol=2 * LEAST)


@pytest.mark.parametrize("calibration", SOME)
def test_the_order_stays_and_nothing_stays_nothing(calibration: Calibration) -> None:
    claimed = np.sort(np.random.default_rng(0).uniform(0.001, 0.99, 300)).astype(np.float32)
    found = calibration(claimed)
    assert (np.diff(found) >= 0).all()
    assert len(np.unique(found)) > 0.95 * len(np.unique(claimed))
    ends = calibration(np.array([[0.0, 1.0]], np.float32))
    assert ends[0, 0] == 0
    assert found[-1] <= ends[0, 1] <= 1
    assert ends.dtype == np.float32


def test_an_image_is_left_as_it_was() -> None:
    claimed = np.array([[0.2, 0.8]], np.float32)
    SOME[0](claimed)
    assert claimed.tolist() == [[np.float32(0.2), np.float32(0.8)]]


@pytest.mark.parametrize(
    "numbers", [(0.0, 0.0), (-1.0, 0.0), (np.nan, 0.0), (1.0, np.nan), (1.0, 1e9), (1e9, 0.0)]
)
def test_calibrations_that_would_turn_or_blow_up_claims_are_refused(numbers: tuple[float, float]) -> None:
    with pytest.raises(ConfigError, match="calibration"):
        Calibration(slope=numbers[0], shift=numbers[1])
