"""Errors of a camera that stand for a whole episode: calibration, a pattern in depth, patches without return.

Averaging frames does not remove them, and all views of an episode share them. Each is drawn from a stream of
its own, so that one that is switched on leaves the others as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpgrasp.camera.fixed_pattern import FixedPattern
from mpgrasp.camera.patches import Patches
from mpgrasp.geometry import FloatArray, rotation_about, transform
from mpgrasp.linear_algebra import norm


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingErrors:
    """Errors of the wrist camera in one episode; None for one that is not there."""

    calibration: FloatArray | None = None
    """`T_camera_believed` (4, 4): pose, in the camera's own frame, in which the camera is believed to be."""
    pattern: FixedPattern | None = None
    patches: Patches | None = None


NO_ERRORS = StandingErrors()


def calibration_error(translation: float, rotation: float, rng: np.random.Generator) -> FloatArray | None:
    """Draw an error of the hand-eye calibration: its size is given, its directions are uniformly random.

    Args:
        translation: distance between the camera and where it is believed to be [m].
        rotation: angle between both orientations [rad].
        rng: drawn from the same number of times whatever the sizes are.

    Returns:
        `T_camera_believed` (4, 4), or None where both sizes are 0.
    """
    along, axis = rng.standard_normal((2, 3))
    if translation == 0 and rotation == 0:
        return None
    return transform(rotation_about(axis, rotation), along / norm(along) * translation)
