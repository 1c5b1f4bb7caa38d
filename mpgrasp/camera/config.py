"""Settings of the wrist camera: intrinsics of the sensor's image, and the square of it that is used."""

from __future__ import annotations

from dataclasses import dataclass

from mpgrasp.depth import CROP, CameraIntrinsics
from mpgrasp.exceptions import ConfigError

D435_INTRINSICS = CameraIntrinsics(fx=385.0, fy=385.0, cx=319.5, cy=239.5, width=640, height=480)
"""Intel RealSense D435, depth stream of 640 x 480 px."""


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """Geometry of the camera's images; a D435 by default."""

    crop: int | None = CROP
    """Central square of the sensor's image that is rendered [px]; None for the whole image."""
    intrinsics: CameraIntrinsics = D435_INTRINSICS
    """Geometry of the sensor's whole image."""

    def __post_init__(self) -> None:
        side = min(self.intrinsics.width, self.intrinsics.height)
        if self.crop is not None and not 1 <= self.crop <= side:
            raise ConfigError("unusable crop of the camera", got=self.crop, allowed=f"1 to {side} [px]")
