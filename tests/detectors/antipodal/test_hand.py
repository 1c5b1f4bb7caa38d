"""The oracle's idea of the hand is never smaller than the hand that grasps."""

from __future__ import annotations

import pytest

from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.robot import hand


def test_tips_are_as_thick_as_the_hands() -> None:
    assert HandGeometry().finger_thickness == pytest.approx(hand.FINGER_THICKNESS)


def test_the_opening_is_the_grippers() -> None:
    assert HandGeometry().max_opening == pytest.approx(hand.GRIPPER_MAX_WIDTH)


def test_tips_reach_as_deep_as_execution_sends_them() -> None:
    assert HandGeometry().reach == pytest.approx(ExecutionConfig().palm_depth)
