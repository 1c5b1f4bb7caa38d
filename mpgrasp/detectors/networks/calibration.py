"""Calibration of the quality that a network claims: a grade becomes the probability that the grasp lifts.

The logarithm of the claimed odds is scaled and shifted. That keeps the order of all pixels, and with it every
best grasp, while entropy and threshold get numbers that mean the same for all networks.

References:
    Platt, "Probabilistic Outputs for Support Vector Machines", 1999.
    Guo et al., "On Calibration of Modern Neural Networks", ICML 2017.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError

LEAST = 1e-6
"""Claims are taken for this far from 0 and from 1 at least, where the odds have no logarithm."""
MOST = 100.0
"""Largest slope, and largest shift either way."""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Odds of a lift, as a power of the claimed odds times a factor."""

    slope: float
    """Factor of the claimed log odds; above 0, so that the order stays."""
    shift: float
    """What is added to them."""

    def __post_init__(self) -> None:
        if not 0 < self.slope <= MOST or not abs(self.shift) <= MOST or math.isnan(self.shift):
            raise ConfigError(
                "unusable calibration",
                got=(self.slope, self.shift),
                allowed=f"a slope above 0, up to {MOST:g}, and a shift of up to {MOST:g} either way",
            )

    def __call__(self, claimed: NDArray[np.float32]) -> NDArray[np.float32]:
        """Probability that a grasp lifts, of a claimed quality in [0, 1] of any shape; 0 stays 0."""
        odds = np.clip(claimed, np.float32(LEAST), np.float32(1 - LEAST))
        odds /= 1 - odds
        # p = 1 / (1 + odds^-slope e^-shift)
        lifts = odds ** np.float32(-self.slope)
        lifts *= np.float32(math.exp(-self.shift))
        lifts += 1
        return np.where(claimed > 0, np.divide(1, lifts, out=lifts), np.float32(0))
