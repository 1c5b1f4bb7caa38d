"""Settings of the image processing around a network."""

from __future__ import annotations

from dataclasses import dataclass

from mpgrasp.depth import CROP
from mpgrasp.exceptions import ConfigError


@dataclass(frozen=True, kw_only=True)
class NetworkDetectorConfig:
    """Settings of the image processing before and after the network."""

    crop: int = CROP
    """Side of the central square that the network sees [px]; smaller images are used as far as they go."""
    quality_sigma: float = 2.0
    """Smoothing of the quality [px]."""
    angle_sigma: float = 1.0
    """Smoothing of cosine and sine [px]."""
    width_sigma: float = 1.0
    """Smoothing of the width [px]."""

    def __post_init__(self) -> None:
        if self.crop < 1 or min(self.quality_sigma, self.angle_sigma, self.width_sigma) < 0:
            raise ConfigError("unusable detector settings", got=self, allowed="crop from 1, sigmas from 0")
