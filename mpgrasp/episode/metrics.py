"""Metrics of the reach, apart from whether it ended well: smoothness, first detection, blind drift.

Smoothness is the spectral arc length of the tool's speed (Balasubramanian, Melendez-Calderon, Roby-Brami
and Burdet, "On the analysis of movement smoothness", J. NeuroEngineering and Rehabilitation 12:112, 2015),
which, unlike jerk, depends neither on how long a motion takes nor on how fast it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import PEAK_QUALITY, GraspMap, peak_height
from mpgrasp.linear_algebra import norm

if TYPE_CHECKING:
    from mpgrasp.motion.arm_driver import ArmDriver

DETECTION_QUALITY = PEAK_QUALITY
"""Peak of the quality map above which something counts as detected, whatever a controller's threshold is."""
CUTOFF = 10.0
"""Highest frequency that the arc runs to [Hz]."""
AMPLITUDE = 0.05
"""Share of the spectrum's greatest magnitude below which the arc ends, if that is earlier."""
PADDING = 4
"""The speed is padded with zeros to this power of two more than its length asks for."""


def spectral_arc_length(speed: FloatArray, rate: float) -> float:
    """Return the smoothness of a motion, below 0; a single bell-shaped movement has about -1.4 to -1.6.

    Args:
        speed: (n,) magnitudes of velocity, any unit.
        rate: of the samples [Hz].

    Returns:
        The negative length of the normalised magnitude spectrum over the normalised frequency; NaN
        for a motion that does not move.
    """
    speed = np.asarray(speed, float)
    if len(speed) < 2 or not np.any(speed):
        return np.nan
    length = 1 << (int(np.ceil(np.log2(len(speed)))) + PADDING)
    magnitude = np.abs(np.fft.rfft(speed, length))
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    magnitude = (magnitude / magnitude.max())[frequency <= CUTOFF]
    last = int(np.flatnonzero(magnitude >= AMPLITUDE)[-1]) + 1
    if last < 2:
        return np.nan
    return -float(np.sum(np.hypot(np.diff(magnitude[:last]), 1.0 / (last - 1))))


class ReachMetrics:
    """Follows one reach from look to look and from tick to tick."""

    def __init__(self) -> None:
        self.first_detection_s: float | None = None
        """Time of the first look that detected something [s]; None while nothing has."""
        self.blind_drift_m = 0.0
        """Horizontal way of the tool point before the first detection [m]."""
        self._speeds: list[float] = []
        self._dt = np.nan

    def look(self, time: float, grasp_map: GraspMap) -> None:
        """Take a view of the scene into account, `time` after the start [s]."""
        if self.first_detection_s is None and peak_height(grasp_map.quality) > DETECTION_QUALITY:
            self.first_detection_s = time

    def tick(self, driver: ArmDriver) -> None:
        """Take a tick of the velocity loop into account; can be handed to `ArmDriver.drive`."""
        velocity, self._dt = driver.twist_achieved[:3], driver.config.dt
        self._speeds.append(norm(velocity))
        if self.first_detection_s is None:
            self.blind_drift_m += norm(velocity[:2]) * self._dt

    @property
    def spectral_arc_length(self) -> float:
        """Smoothness of the reach so far; see `spectral_arc_length`."""
        return spectral_arc_length(np.array(self._speeds), 1.0 / self._dt)
