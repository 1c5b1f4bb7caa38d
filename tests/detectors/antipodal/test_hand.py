"""The oracle's idea of the hand is never smaller than the hand that grasps."""

from __future__ import annotations

import pytest

from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.robot import hand


def test_pads_tips_and_opening_are_the_franka_hands() -> None:
    geometry = HandGeometry()
    assert (geometry.pad_width, geometry.finger_thickness, geometry.max_opening) == (0.0176, 0.0144, 0.080)
    robots = (hand.FINGER_WIDTH, hand.FINGER_THICKNESS, hand.GRIPPER_MAX_WIDTH)
    assert robots == (geometry.pad_width, geometry.finger_thickness, geometry.max_opening)


def test_tips_reach_as_deep_as_execution_sends_them() -> None:
    assert HandGeometry().reach == pytest.approx(ExecutionConfig().palm_depth)


def test_the_margin_leaves_room_for_the_opening_that_execution_adds() -> None:
    assert HandGeometry().opening_margin == pytest.approx(ExecutionConfig().opening_margin)
