"""Scales of ladders, and methods of which all is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mpgrasp.thresholds import Scale

LEVELS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6)
STICKS = Scale(levels=LEVELS, logarithmic=True, harder="lower")
LINE = Scale(levels=(0.0, 1.0, 2.0, 3.0, 4.0, 5.0), harder="higher")


def curve(middle: float, width: float, lapse: float = 0.0) -> Callable[[float], float]:
    """Success over thickness: half at the middle, from 10 to 90 % within a width in its logarithm."""

    def rate(level: float) -> float:
        return float((1 - lapse) / (1 + np.exp(-2 * np.log(9) / width * np.log(level / middle))))

    return rate
