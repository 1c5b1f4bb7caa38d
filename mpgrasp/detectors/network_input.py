"""From a depth image without holes to what a network reads: the same in training and in the loop.

The published GG-CNN code feeds depth minus its mean, in metres, clipped to +-1. A stick 4 mm high is then a
step of 0.004, below what a freshly initialised network reacts to: the residual can be scaled up. On a
crowded table the mean is no longer the table: the median can be taken instead. And the residual hides how
far away the scene is, and with that how many pixels the gripper can open: a second channel can tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.exceptions import ConfigError

RANGE_CENTRE, RANGE_SPREAD = 0.45, 0.15
"""The middle of the distances that the wrist camera sees the table at, and their spread [m]."""


@dataclass(frozen=True, kw_only=True)
class NetworkInput:
    """How depth is presented to a network. The defaults are the published GG-CNN's."""

    size: int = NETWORK_SIZE
    """Side of the input image [px]."""
    centre: str = "mean"
    """What is subtracted: "mean" or "median" of the image."""
    clip: float = 1.0
    """Bound on the residual before it is scaled [m]."""
    scale: float = 1.0
    """Input units per metre."""
    range_channel: bool = False
    """Whether a second channel, the same everywhere, carries the distance of that centre."""

    def __post_init__(self) -> None:
        if self.centre not in ("mean", "median"):
            raise ConfigError("unknown centre of a depth image", got=self.centre, allowed=("mean", "median"))
        if self.size < 32 or min(self.clip, self.scale) <= 0:
            raise ConfigError(
                "unusable network input", got=self, allowed="size from 32, clip and scale above 0"
            )

    @property
    def channels(self) -> int:
        """Channels of the input."""
        return 2 if self.range_channel else 1

    def __call__(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Input (channels, H, W) for a depth image (H, W) [m] without NaN."""
        middle = float(np.median(depth[::2, ::2]) if self.centre == "median" else depth.mean())
        residual = np.clip(depth - middle, -self.clip, self.clip) * np.float32(self.scale)
        if not self.range_channel:
            return residual[None].astype(np.float32)
        distance = np.full_like(residual, (middle - RANGE_CENTRE) / RANGE_SPREAD)
        return np.stack([residual, distance]).astype(np.float32)
