"""Random streams of an episode's seed, beside those of its scene."""

from __future__ import annotations

import numpy as np

_NOISE_STREAM = 11
_START_STREAM = 12
_CONTROLLER_STREAM = 13
_CALIBRATION_STREAM = 15
_PATTERN_STREAM = 16
_PATCHES_STREAM = 17
_FORCE_STREAM = 18


def noise_rng(seed: int, tick: int) -> np.random.Generator:
    """Return the generator of a tick's sensor noise, which does not depend on the ticks before."""
    return np.random.default_rng([seed, _NOISE_STREAM, tick])


def calibration_rng(seed: int) -> np.random.Generator:
    """Return the generator of the error of the hand-eye calibration."""
    return np.random.default_rng([seed, _CALIBRATION_STREAM])


def pattern_rng(seed: int) -> np.random.Generator:
    """Return the generator of the sensor's pattern that stays."""
    return np.random.default_rng([seed, _PATTERN_STREAM])


def patches_rng(seed: int) -> np.random.Generator:
    """Return the generator of the patches without return."""
    return np.random.default_rng([seed, _PATCHES_STREAM])


def force_rng(seed: int, tick: int) -> np.random.Generator:
    """Return the generator of the noise on forces in the execution that begins at a control tick."""
    return np.random.default_rng([seed, _FORCE_STREAM, tick])


def start_rng(seed: int) -> np.random.Generator:
    """Return the generator of the start pose."""
    return np.random.default_rng([seed, _START_STREAM])


def controller_seed(seed: int, attempt: int = 0) -> int:
    """Return the seed that the controller of an attempt is told; the scene cannot be built from it."""
    stream = [seed, _CONTROLLER_STREAM, attempt] if attempt else [seed, _CONTROLLER_STREAM]
    return int(np.random.default_rng(stream).integers(2**32))
