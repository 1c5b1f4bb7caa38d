"""Settings of the detectors: the image processing around a network, and the hand that the oracle knows."""

from __future__ import annotations

from dataclasses import dataclass

from mpgrasp.depth import CROP
from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.exceptions import ConfigError
from mpgrasp.robot import hand


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
    calibrated: bool = True
    """True if the quality is the probability that a grasp lifts, where the weights tell how claims become
    one; False for the quality as the network claims it."""

    def __post_init__(self) -> None:
        if self.crop < 1 or min(self.quality_sigma, self.angle_sigma, self.width_sigma) < 0:
            raise ConfigError("unusable detector settings", got=self, allowed="crop from 1, sigmas from 0")


@dataclass(frozen=True, kw_only=True)
class HeuristicConfig:
    """Settings of the heuristic: how much stands out of the table."""

    crop: int = CROP
    """Side of the central square that is looked at [px]; smaller images are used as far as they go."""
    deviations: float = 4.0
    """Height over the median depth, in standard deviations of the depth, from which something stands out."""
    min_height: float = 0.001
    """Least height from which something stands out [m]."""
    min_area: int = 30
    """Least number of pixels of something, in an image of 224 px."""
    clearance: float = 0.012
    """Gap that is left beside an object for each finger [m]."""

    def __post_init__(self) -> None:
        lengths = self.deviations, self.min_height, self.clearance
        if min(self.crop, self.min_area) < 1 or not all(length >= 0 for length in lengths):
            raise ConfigError(
                "unusable heuristic settings", got=self, allowed="crop and area from 1, others from 0"
            )


@dataclass(frozen=True, kw_only=True)
class OracleConfig(HandGeometry):
    """The hand as the oracle sees it: without the play that labels for networks have.

    The labels leave out what a camera can hardly tell; the oracle knows the cloth under each finger tip. Of
    280 trials with sticks of 1 mm, none lifted where the contacts lay 0.25 mm or more below the tips'
    expected height, 36 % where they lay less below it, 65 % up to 0.25 mm above it, and 87 % beyond that.
    """

    footprint: tuple[float, float] = (hand.FINGER_WIDTH, hand.FINGER_THICKNESS)
    """Area that a tip lands on, across and along the closing direction [m]."""
    wider: tuple[float, ...] = (0.012, 0.016, 0.020, 0.025)
    """Wider margins, in rising order, that are tried for thin things [m]."""
    min_depth: float = -0.0002
    """Least height of the contacts above the tips [m]; below 0, because the heights are not exact."""
    depth_range: float = 0.001
    """Height above the least at which a grasp is nearly as good as a deeper one [m]."""
