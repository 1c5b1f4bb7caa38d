"""Phases of an execution: pre-grasp, guarded descent, close, lift, hold and shake.

The grasp's position is a point on the seen surface. The fingers go as deep as palm and support allow,
because pads that touch above the widest section squeeze an object down and out. How high an uneven cloth
lies under the fingers is not known to a millimetre, so they feel for it, and then rise a little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.motion.driver import Driver
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.trajectory import shake_offset
from mpgrasp.robot import hand


class Execution:
    """State that the phases of one execution share: the grasp, the driver, and what was found so far.

    Args:
        driver: moves the hand.
        grasp: what to grasp.
        config: speeds, forces, times and heights.
        yaw: heading of the hand's x axis [rad].
        on_tick: is told the phase on every tick of the velocity loop.
    """

    def __init__(
        self,
        driver: Driver,
        grasp: Grasp,
        config: ExecutionConfig,
        *,
        yaw: float,
        on_tick: Callable[[str], None] | None = None,
    ) -> None:
        self.driver, self.grasp, self.config, self.yaw = driver, grasp, config, yaw
        self.simulation = driver.simulation
        self.phase = next(iter(PHASES))
        """Name of the phase that is played."""
        self.start = self.simulation.time
        """Simulated time at which it began [s]."""
        self.rest = {name: self.height_of(name) for name in self.simulation.scene.objects}
        """Height of each object at rest, by name [m]."""
        # no deeper than the palm allows, nor than the table
        self.planned = max(-config.overtravel, float(grasp.position[2]) - config.palm_depth)
        """Height of the finger tips over the table that is aimed at [m]."""
        self.contact_height: float | None = None
        """Height of the finger tips over the table at first contact [m]."""
        self.tip_height = np.nan
        """Height of the finger tips over the table when they closed [m]."""
        self.between: tuple[str, ...] = ()
        """Objects that touched both pads when the lift began."""
        self.width = np.nan
        """Opening of the gripper when the lift began [m]."""
        self._on_tick = on_tick

    def play(self, phases: Mapping[str, Phase]) -> None:
        """Play phases in order, up to a protective stop."""
        for name, phase in phases.items():
            self.phase = name
            phase(self)
            if self.driver.reflex is not None:
                break

    def pose(self, z: float) -> FloatArray:
        """Pose (4, 4) of the tool over the grasp at a height [m]."""
        return looking_down([self.grasp.position[0], self.grasp.position[1], z], self.yaw)

    def move(self, target: FloatArray, speed: float, until: Callable[[], bool] | None = None) -> bool:
        """Move to a pose (4, 4) at a speed [m/s]; False if `until` or a protective stop cut it short."""
        return self.driver.move_to(
            target, speed, until=until, deceleration=self.config.contact_deceleration, on_tick=self.tick
        )

    def rise(self, height: float, speed: float) -> None:
        """Move up by a height [m] at a speed [m/s]."""
        target = self.driver.T_desired.copy()
        target[2, 3] += height
        self.move(target, speed)

    def tick(self, _: Driver) -> None:
        """Tell the phase to whoever asked for it."""
        if self._on_tick is not None:
            self._on_tick(self.phase)

    def tip(self) -> float:
        """Height of the finger tips over the table [m]."""
        return float(self.simulation.T_world_tcp[2, 3]) - hand.FINGERTIP_BEYOND_TCP

    def height_of(self, name: str) -> float:
        """Height of an object's frame over the table [m]."""
        return float(self.simulation.object_pose(name)[2, 3])


Phase = Callable[[Execution], None]


def pregrasp(execution: Execution) -> None:
    """Open the gripper and come to rest above the grasp."""
    c, position = execution.config, execution.grasp.position
    execution.simulation.open_gripper(min(execution.grasp.width + c.opening_margin, hand.GRIPPER_MAX_WIDTH))
    target = execution.pose(float(position[2]) + c.approach)
    missing = float(target[2, 3] - execution.driver.T_desired[2, 3])
    if missing > 1e-3:
        # up first: the hand may stand between objects
        execution.rise(missing, c.approach_speed)
    execution.move(target, c.approach_speed)


def descend(execution: Execution) -> None:
    """Go down to the planned height, slower from stage to stage, or until the fingers feel something."""
    c, driver = execution.config, execution.driver
    entry = max(float(execution.grasp.position[2]) + c.entry_height, c.guarded_height)
    stages = (
        (entry, c.descent_speed),
        (max(execution.planned, c.guarded_height), c.entry_speed),
        (execution.planned, c.guarded_speed),
    )
    for tip, speed in stages:
        target = execution.pose(tip + hand.FINGERTIP_BEYOND_TCP)
        if target[2, 3] >= driver.T_desired[2, 3]:
            continue
        reached = execution.move(target, speed, until=lambda: driver.touch > c.contact_threshold)
        if not reached and driver.reflex is None:
            _back_off(execution)
            break
    execution.tip_height = execution.tip()


def _back_off(execution: Execution) -> None:
    """Note the height of the contact and rise a little above it."""
    c = execution.config
    execution.contact_height = execution.tip()
    # the desired pose lies below the felt contact by what the servo gave way
    free = execution.contact_height + hand.FINGERTIP_BEYOND_TCP + c.back_off
    execution.rise(max(0.0, free - execution.driver.T_desired[2, 3]), c.guarded_speed)


def close(execution: Execution) -> None:
    """Close the gripper until it comes to rest, and note what lies between the pads."""
    c, simulation = execution.config, execution.simulation
    simulation.close_gripper(c.grip_force)
    widths: list[float] = []

    def settled() -> bool:
        widths.append(simulation.gripper_width)
        # the grip force builds up within 0.1 s after the pads have met something
        return len(widths) > 20 and max(widths[-12:]) - min(widths[-12:]) < 1e-4

    execution.driver.wait(c.settle_time, execution.tick, until=settled)
    left, right = simulation.pad_contacts()
    execution.between = tuple(sorted(left & right))
    execution.width = simulation.gripper_width


def lift(execution: Execution) -> None:
    """Carry up whatever is held."""
    execution.rise(execution.config.lift, execution.config.lift_speed)


def hold(execution: Execution) -> None:
    """Stand still."""
    execution.driver.wait(execution.config.hold_time, execution.tick)


def shake(execution: Execution) -> None:
    """Shake sideways, both along and across the closing direction, then up and down."""
    c = execution.config
    R = execution.driver.T_desired[:3, :3]

    def offset(axis: FloatArray, t: float) -> FloatArray:
        return axis * shake_offset(t, c.shake_amplitude, c.shake_frequency, c.shake_time)

    for axis in ((R[:, 0] + R[:, 1]) / np.sqrt(2), np.array([0.0, 0.0, 1.0])):
        execution.driver.follow(partial(offset, axis), c.shake_time, execution.tick)
    execution.driver.wait(c.settle_after_shake, execution.tick)


PHASES: Mapping[str, Phase] = {
    "pregrasp": pregrasp, "descend": descend, "close": close, "lift": lift, "hold": hold, "shake": shake,
}  # fmt: skip
"""Phases of an execution by name, in order."""
