"""Spaces of what the environments observe, as gymnasium has them."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from mpgrasp.camera.rasteriser import FAR
from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.recording.policy_view import IMAGE

OBSERVATIONS = ("arrays", "images")
"""What is observed: everything at its size and unit, or what learners with convolutions take."""


def space_of(observations: str, longest: float) -> spaces.Dict:
    """Return the space of the observations of a kind, with times of up to `longest` [s]."""
    if observations == "images":
        return spaces.Dict(
            image=spaces.Box(0, 255, (2, IMAGE, IMAGE), np.uint8),
            state=spaces.Box(-2.0, 2.0, (6,), np.float32),
        )
    image = (NETWORK_SIZE, NETWORK_SIZE)
    return spaces.Dict(
        depth=spaces.Box(0.0, FAR, image, np.float32),
        quality=spaces.Box(0.0, 1.0, image, np.float32),
        tcp=spaces.Box(-2.0, 2.0, (3,), np.float32),  # farther than the arm reaches
        yaw=spaces.Box(-np.float32(np.pi), np.float32(np.pi), (1,), np.float32),
        time=spaces.Box(0.0, longest, (1,), np.float32),
    )
