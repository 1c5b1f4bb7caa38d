"""Pattern of a stereo camera's depth that stays: waves in disparity that averaging frames does not remove.

Users of the D400 series find waves that ten averaged frames still show (librealsense, issue 1375) and that
stay where they are in the image when the camera moves along a wall, from what is left of the lenses'
distortion after rectification (issue 3210).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpgrasp.camera.noise import DepthNoise, correlated_noise

_TURNS = 4
"""Pairs of fields that a pattern turns between in time."""


class FixedPattern:
    """Disparity error of every pixel, a stationary Gaussian process in time.

    Without a time constant one field stands for ever. With one, T, the pattern is a sum of fields that turn
    into one another at rates drawn from a Cauchy distribution of scale 1/T, whose characteristic function
    makes the autocorrelation over all patterns exp(-t/T). It is a function of time alone, whatever was
    looked at before.

    Args:
        noise: the sensor.
        shape: (H, W) of the image.
        scale: focal length of the image in that of the sensor.
        rng: source of the pattern.
    """

    def __init__(
        self, noise: DepthNoise, shape: tuple[int, int], scale: float, rng: np.random.Generator
    ) -> None:
        turns = _TURNS if noise.pattern_time > 0 else 1
        self._rates = rng.standard_cauchy(_TURNS)[:turns] / (noise.pattern_time or np.inf)
        blur = noise.pattern_px * scale
        amplitude = np.float32(noise.fixed_pattern / np.sqrt(turns))
        self._fields = [
            [
                amplitude * correlated_noise(shape, blur, rng)
                for _ in range(2 if noise.pattern_time > 0 else 1)
            ]
            for _ in range(turns)
        ]

    def at(self, time: float) -> NDArray[np.float32]:
        """Disparity error (H, W) [px of the sensor] at a time [s]."""
        if self._rates[0] == 0:
            return self._fields[0][0]
        total = np.zeros_like(self._fields[0][0])
        for rate, (cosine, sine) in zip(self._rates, self._fields, strict=True):
            total += np.float32(np.cos(rate * time)) * cosine + np.float32(np.sin(rate * time)) * sine
        return total
