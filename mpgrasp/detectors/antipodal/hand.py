"""Geometry of the hand for the grasp analysis: boxes around pads, fingers, palm and wrist camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.robot import hand


@dataclass(frozen=True, kw_only=True)
class HandGeometry:
    """The hand as the analysis sees it: boxes around pads, fingers and palm; a Panda hand by default."""

    pad_width: float = hand.FINGER_WIDTH
    """Width of a pad across the closing direction [m]."""
    play: float = 0.004
    """Free space wanted around a finger across the closing direction, both sides together [m]."""
    finger_thickness: float = hand.FINGER_THICKNESS
    """Space that a finger tip needs outside of the opening [m]."""
    shaft_thickness: float = 0.026
    """Space that a finger needs outside of the opening above its straight tip [m]."""
    tip_height: float = 0.016
    """Height of the straight tip [m]."""
    max_opening: float = hand.GRIPPER_MAX_WIDTH
    """Widest opening between the pads [m]."""
    max_contact_width: float = 0.072
    """Widest thing to close on, so that both fingers still pass beside it [m]."""
    reach: float = 0.042
    """Depth to which the tips go below the surface point before the palm comes near [m]."""
    palm_clearance: float = 0.045
    """Height above the tips that nothing under the palm may exceed [m]."""
    palm_size: tuple[float, float] = (0.204, 0.064)
    """The palm along and across the closing direction [m]."""
    camera_clearance: float = 0.070
    """Height above the tips that nothing under the wrist camera may exceed [m]."""
    camera_offset: float = 0.070
    """Distance from the tool point to the camera, across the closing direction and on either side [m]."""
    camera_size: tuple[float, float] = (0.094, 0.034)
    """The camera along and across the closing direction, with a little play [m]."""
    footprint: tuple[float, float] = (hand.FINGER_WIDTH + 0.004, hand.FINGER_THICKNESS + 0.002)
    """Part of the support that may stop a tip, across and along the closing direction, play included [m]."""
    tip_clearance: float = 0.0005
    """Height of the tips over what they stop on [m]."""
    margin: tuple[float, float] = (0.005, 0.008)
    """Least and wanted free space between object and open pad, on each side [m]."""
    wider: tuple[float, ...] = ()
    """Wider margins, in rising order, tried for thin things: the tips may land lower, and meet no crest
    on the way in [m]. None: the wanted margin alone, and nothing but the landing counts."""
    opening_margin: float = 0.010
    """Opening that the execution adds to a grasp's width, both sides together [m]; at most twice the least
    margin."""
    min_depth: float = 0.0012
    """Least height of the contacts above the tips [m]."""
    depth_range: float = 0.002
    """Height above the least at which a grasp is nearly as good as a deeper one [m]."""
    friction_angle: float = np.deg2rad(25.0)
    """Half the friction cone, on the safe side [rad]."""

    def __post_init__(self) -> None:
        if not 0 < self.max_contact_width < self.max_opening:
            raise ConfigError(
                "contact width outside of the opening",
                got=self.max_contact_width,
                allowed=f"between 0 and max_opening = {self.max_opening}",
            )
        if not 0 <= self.margin[0] < self.margin[1]:
            raise ConfigError("margins out of order", got=self.margin, allowed="(least, wanted), least first")
        if not 0 <= self.opening_margin <= 2 * self.margin[0]:
            raise ConfigError(
                "unusable opening margin", got=self.opening_margin, allowed=f"0 to {2 * self.margin[0]}"
            )
