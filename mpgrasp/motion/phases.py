"""Phases of an execution: pre-grasp, guarded descent, close, lift, hold and shake.

The grasp's position is a point on the seen surface. The fingers go as deep as palm and support allow,
because pads that touch above the widest section squeeze an object down and out. How high an uneven cloth
lies under the fingers is not known to a millimetre, so they feel for it, and then rise a little.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from mpgrasp.geometry import FloatArray
from mpgrasp.motion.execution_state import ExecutionState, Phase
from mpgrasp.motion.trajectory import shake_offset
from mpgrasp.robot import hand


def pregrasp(state: ExecutionState) -> None:
    """Open the gripper and come to rest above the grasp."""
    c, position = state.config, state.grasp.position
    state.simulation.open_gripper(min(state.grasp.width + c.opening_margin, hand.GRIPPER_MAX_WIDTH))
    target = state.pose(float(position[2]) + c.approach)
    missing = float(target[2, 3] - state.driver.T_desired[2, 3])
    if missing > 1e-3:
        # up first: the hand may stand between objects
        state.rise(missing, c.approach_speed)
    state.move(target, c.approach_speed)


def descend(state: ExecutionState) -> None:
    """Go down to the planned height, slower from stage to stage, or until the fingers feel something."""
    c, driver = state.config, state.driver
    entry = max(float(state.grasp.position[2]) + c.entry_height, c.guarded_height)
    stages = (
        (entry, c.descent_speed),
        (max(state.planned, c.guarded_height), c.entry_speed),
        (state.planned, c.guarded_speed),
    )
    for tip, speed in stages:
        target = state.pose(tip + hand.FINGERTIP_BEYOND_TCP)
        if target[2, 3] >= driver.T_desired[2, 3]:
            continue
        reached = state.move(target, speed, until=lambda: state.felt() > c.contact_threshold)
        if not reached and driver.reflex is None:
            _back_off(state)
            break
    state.tip_height = state.tip()


def _back_off(state: ExecutionState) -> None:
    """Note the height of the contact and rise a little above it."""
    c = state.config
    state.contact_height = state.tip()
    # the desired pose lies below the felt contact by what the servo gave way
    free = state.contact_height + hand.FINGERTIP_BEYOND_TCP + c.back_off
    state.rise(max(0.0, free - state.driver.T_desired[2, 3]), c.guarded_speed)


def close(state: ExecutionState) -> None:
    """Close the gripper until it comes to rest, and note what the fingers clamp."""
    c, simulation = state.config, state.simulation
    simulation.close_gripper(c.grip_force)
    widths: list[float] = []

    def settled() -> bool:
        widths.append(simulation.gripper_width)
        # the grip force builds up within 0.1 s after the pads have met something
        return len(widths) > 20 and max(widths[-12:]) - min(widths[-12:]) < 1e-4

    state.driver.wait(c.settle_time, state.tick, until=settled)
    state.between = tuple(sorted(simulation.held()))
    state.width = simulation.gripper_width


def lift(state: ExecutionState) -> None:
    """Carry up whatever is held."""
    state.rise(state.config.lift, state.config.lift_speed)


def hold(state: ExecutionState) -> None:
    """Stand still."""
    state.driver.wait(state.config.hold_time, state.tick)


def shake(state: ExecutionState) -> None:
    """Shake sideways, both along and across the closing direction, then up and down."""
    c = state.config
    R = state.driver.T_desired[:3, :3]

    def offset(axis: FloatArray, t: float) -> FloatArray:
        return axis * shake_offset(t, c.shake_amplitude, c.shake_frequency, c.shake_time)

    for axis in ((R[:, 0] + R[:, 1]) / np.sqrt(2), np.array([0.0, 0.0, 1.0])):
        state.driver.follow(partial(offset, axis), c.shake_time, state.tick)
    state.driver.wait(c.settle_after_shake, state.tick)


PHASES: Mapping[str, Phase] = {
    "pregrasp": pregrasp, "descend": descend, "close": close, "lift": lift, "hold": hold, "shake": shake,
}  # fmt: skip
"""Phases of an execution by name, in order."""
