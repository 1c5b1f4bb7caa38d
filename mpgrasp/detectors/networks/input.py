"""Input of a network, made from an image without holes: the same in training and in the loop.

The paper feeds depth (D), colour (RGB) or both (RGB-D). The published GG-CNN code feeds depth minus its mean,
in metres, clipped to +-1. A stick 4 mm high is then a step of 0.004, below what a freshly initialised
network reacts to: the residual can be scaled up. On a crowded table the mean is no longer the table: the
median can be taken instead. Colour is fed as in the published GR-ConvNet code: as a share of full
brightness, minus the image's mean.
"""

from __future__ import annotations

from dataclasses import InitVar, dataclass

import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.exceptions import ConfigError

CHANNELS = {"d": 1, "rgb": 3, "rgbd": 4}
"""Input channels by modality."""
MIN_SIZE, MAX_SIZE = 32, 1024
"""Sides of the images that networks are fed [px]."""
MAX_CLIP = 100.0
"""Widest bound on a residual of depth [m]."""
MAX_SCALE = 1e4
"""Most input units per metre: a tenth of a millimetre is 1."""


@dataclass(frozen=True, kw_only=True)
class NetworkInput:
    """Form in which images are presented to a network. The defaults are the published GG-CNN's."""

    size: int = NETWORK_SIZE
    """Side of the input image [px]."""
    modality: str = "d"
    """"d": depth, "rgb": colour, "rgbd": depth, then colour."""
    centre: str = "mean"
    """Value that is subtracted from depth: "mean" or "median" of the image."""
    clip: float = 1.0
    """Bound on the residual before it is scaled [m]."""
    scale: float = 1.0
    """Input units per metre."""
    range_channel: InitVar[bool] = False
    """Weight files from before colour say false here; nothing else can be read."""

    def __post_init__(self, range_channel: bool) -> None:
        if self.modality not in CHANNELS:
            raise ConfigError("unknown modality of an input", got=self.modality, allowed=tuple(CHANNELS))
        if self.centre not in ("mean", "median"):
            raise ConfigError("unknown centre of a depth image", got=self.centre, allowed=("mean", "median"))
        fits = MIN_SIZE <= self.size <= MAX_SIZE and 0 < self.clip <= MAX_CLIP and 0 < self.scale <= MAX_SCALE
        if not (fits and isinstance(self.size, int)):
            raise ConfigError(
                "unusable network input",
                got=self,
                allowed=f"size {MIN_SIZE} to {MAX_SIZE}, clip above 0 up to {MAX_CLIP:g}, scale above 0 up to"
                f" {MAX_SCALE:g}",
            )
        if range_channel:
            raise ConfigError("an input with a range channel", got=range_channel, allowed="d, rgb, rgbd")

    @property
    def channels(self) -> int:
        """Channels of the input."""
        return CHANNELS[self.modality]

    @property
    def reads_depth(self) -> bool:
        """True if depth is part of the input."""
        return self.modality != "rgb"

    @property
    def reads_colour(self) -> bool:
        """True if colour is part of the input."""
        return self.modality != "d"

    def __call__(
        self, depth: NDArray[np.float32], rgb: NDArray[np.uint8] | None = None
    ) -> NDArray[np.float32]:
        """Return the input (channels, H, W) for a depth image (H, W) [m] without NaN, and colour (H, W, 3).

        Raises:
            ConfigError: the modality has colour and there is none, or one of another size.
        """
        planes: list[NDArray[np.float32]] = []
        if self.reads_depth:
            middle = float(np.median(depth[::2, ::2]) if self.centre == "median" else depth.mean())
            residual = np.clip(depth - np.float32(middle), -self.clip, self.clip) * np.float32(self.scale)
            planes.append(residual[None].astype(np.float32, copy=False))
        if self.reads_colour:
            if rgb is None or rgb.shape != (*depth.shape, 3):
                raise ConfigError(
                    f"input {self.modality} without a colour image that fits",
                    got=None if rgb is None else rgb.shape,
                    allowed=f"(H, W, 3) = {(*depth.shape, 3)}",
                )
            colour = np.moveaxis(rgb, -1, 0).astype(np.float32) / np.float32(255)
            planes.append(colour - colour.mean(axis=(1, 2), keepdims=True))
        return np.concatenate(planes)
