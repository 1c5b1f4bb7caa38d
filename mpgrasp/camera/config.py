"""Settings of the wrist camera: intrinsics of the sensor's image, and the square of it that is used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
    latency: float | Literal["measured"] = 0.0
    """Time after which what is seen acts [s]; "measured": the detector's own run time, so that a slow one
    pays, and no two runs are equal bit for bit."""
    calibration_translation: float = 0.0
    """Distance from the camera to where it is believed to be, in a direction that each episode draws [m]."""
    calibration_rotation: float = 0.0
    """Angle from its orientation to the believed one, about an axis that each episode draws [rad]."""

    def __post_init__(self) -> None:
        side = min(self.intrinsics.width, self.intrinsics.height)
        if self.crop is not None and not 1 <= self.crop <= side:
            raise ConfigError("unusable crop of the camera", got=self.crop, allowed=f"1 to {side} [px]")
        if self.latency != "measured" and not (
            isinstance(self.latency, float | int) and 0 <= self.latency <= 5
        ):
            raise ConfigError("latency of the camera", got=self.latency, allowed="0 to 5 [s], or measured")
        for name, most, unit in (("calibration_translation", 0.2, "m"), ("calibration_rotation", 0.5, "rad")):
            if not 0 <= getattr(self, name) <= most:
                raise ConfigError(
                    f"{name} of the camera", got=getattr(self, name), allowed=f"0 to {most} [{unit}]"
                )
