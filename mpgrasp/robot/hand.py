"""The Franka Hand: dimensions, speeds and forces, for whoever needs them without MuJoCo.

Source: the Franka Hand's product manual and franka_description.
"""

from __future__ import annotations

TCP_OFFSET = 0.1034
"""From the hand frame to the tool point, along the approach axis [m]."""
FINGERTIP_BEYOND_TCP = 0.0087
"""From the tool point to the finger tips, along the approach axis [m]."""
FINGER_WIDTH = 0.0176
"""Width of a finger tip across the closing direction [m]."""
FINGER_THICKNESS = 0.0144
"""Thickness of a finger tip along the closing direction [m]."""
GRIPPER_MAX_WIDTH = 0.08
"""Opening between the pads [m]."""
GRIPPER_SPEED = 0.1
"""Speed at which the opening follows a commanded width: 0.05 m/s for each finger [m/s]."""
GRIPPER_CLOSE_SPEED = 0.05
"""Speed at which the opening shrinks while grasping [m/s]."""
GRIPPER_FORCE_MIN = 30.0
"""Smallest continuous force of each pad [N]."""
GRIPPER_FORCE_MAX = 70.0
"""Largest continuous force of each pad [N]."""
GRIPPER_FORCE_DEFAULT = 40.0
"""Force of each pad unless told otherwise [N]."""
