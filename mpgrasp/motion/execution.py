"""Execution of a chosen grasp: pre-grasp, guarded descent, close, lift, hold, shake, and the verdict.

The grasp's position is a point on the seen surface. The fingers go as deep as palm and support allow,
because pads that touch above the widest section squeeze an object down and out. How high an uneven cloth
lies under the fingers is not known to a millimetre, so they feel for it, and then rise a little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.protocols import Driver
from mpgrasp.motion.reflex import Reflex
from mpgrasp.motion.trajectory import nearest_yaw, shake
from mpgrasp.robot import hand

PHASES = ("pregrasp", "descend", "close", "lift", "hold", "shake")
OUTCOMES = ("success", "reflex", "collision", "missed", "slipped")
"""How an execution can end; the same words as in `Outcome`."""

OnPhase = Callable[[str, ArmDriver], None]


@dataclass(frozen=True, kw_only=True)
class ExecutionResult:
    """What came of a grasp."""

    outcome: str
    """success, reflex, collision, missed or slipped."""
    reason: str
    """The same in a sentence."""
    lifted: str | None = None
    """The object that was lifted, held and shaken."""
    between: tuple[str, ...] = ()
    """Objects that touched both pads when the lift began."""
    reflex: Reflex | None = None
    contact_height: float | None = None
    """Height of the finger tips over the table at first contact [m]; None without contact."""
    planned_height: float = np.nan
    """Height of the finger tips over the table that was aimed at [m]."""
    tip_height: float = np.nan
    """Height of the finger tips over the table when they closed [m]."""
    width: float = np.nan
    """Opening of the gripper when the lift began [m]."""
    duration: float = 0.0
    """Simulated time of the whole execution [s]."""


def execute_grasp(
    driver: ArmDriver, grasp: Grasp, config: ExecutionConfig | None = None, on_tick: OnPhase | None = None
) -> ExecutionResult:
    """Grasp, lift, hold, shake and judge.

    Args:
        driver: drives the arm from wherever it is.
        grasp: what to grasp; its position lies on the seen surface.
        config: how.
        on_tick: is told the phase and the driver on every tick of the velocity loop.

    Returns:
        What came of it. A failed grasp is an outcome, never an exception.

    Raises:
        ConfigError: a grasp that is not finite.
    """
    check_finite(grasp)
    told = None if on_tick is None else lambda phase: on_tick(phase, driver)
    yaw = reachable_yaw(driver, grasp)
    return Execution(driver, grasp, config or ExecutionConfig(), yaw=yaw, on_tick=told).play()


def check_finite(grasp: Grasp) -> None:
    """Raise ConfigError for a grasp that is not finite."""
    if not np.all(np.isfinite([*grasp.position, grasp.angle, grasp.width])):
        raise ConfigError("grasp is not finite", got=(list(grasp.position), grasp.angle, grasp.width))


class Execution:
    """One execution, phase by phase.

    Args:
        driver: moves the hand.
        grasp: what to grasp.
        config: how.
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
        self._on_tick = on_tick
        self.simulation = driver.simulation
        self.phase = PHASES[0]
        self.start = self.simulation.time
        self.rest = {name: float(self._height(name)) for name in self.simulation.scene.objects}
        # no deeper than the palm allows, nor than the table
        self.planned = max(-config.overtravel, float(grasp.position[2]) - config.palm_depth)
        self.contact_height: float | None = None
        self.tip_height = np.nan
        self.between: tuple[str, ...] = ()
        self.width = np.nan

    def play(self) -> ExecutionResult:
        """Play all phases, or up to a protective stop, and judge."""
        for phase, act in (
            ("pregrasp", self._pregrasp), ("descend", self._descend), ("close", self._close),
            ("lift", self._lift), ("hold", self._hold), ("shake", self._shake),
        ):  # fmt: skip
            self.phase = phase
            act()
            if self.driver.reflex is not None:
                break
        return replace(
            self._verdict(),
            between=self.between,
            reflex=self.driver.reflex,
            contact_height=self.contact_height,
            planned_height=self.planned,
            tip_height=self.tip_height,
            width=self.width,
            duration=self.simulation.time - self.start,
        )

    def _pregrasp(self) -> None:
        c = self.config
        self.simulation.open_gripper(min(self.grasp.width + c.opening_margin, hand.GRIPPER_MAX_WIDTH))
        target = self._pose(float(self.grasp.position[2]) + c.approach)
        missing = float(target[2, 3] - self.driver.T_desired[2, 3])
        if missing > 1e-3:
            # up first: the hand may stand between objects
            self._rise(missing, c.approach_speed)
        self._move(target, c.approach_speed)

    def _descend(self) -> None:
        c = self.config
        entry = max(float(self.grasp.position[2]) + c.entry_height, c.guarded_height)
        stages = (
            (entry, c.descent_speed),
            (max(self.planned, c.guarded_height), c.entry_speed),
            (self.planned, c.guarded_speed),
        )
        for tip, speed in stages:
            target = self._pose(tip + hand.FINGERTIP_BEYOND_TCP)
            if target[2, 3] >= self.driver.T_desired[2, 3]:
                continue
            reached = self._move(target, speed, until=lambda: self.driver.touch > c.contact_threshold)
            if not reached and self.driver.reflex is None:
                self._back_off()
                break
        self.tip_height = self._tip()

    def _back_off(self) -> None:
        c = self.config
        self.contact_height = self._tip()
        # the desired pose lies below the felt contact by what the servo gave way
        free = self.contact_height + hand.FINGERTIP_BEYOND_TCP + c.back_off
        self._rise(max(0.0, free - self.driver.T_desired[2, 3]), c.guarded_speed)

    def _close(self) -> None:
        c, simulation = self.config, self.simulation
        simulation.close_gripper(c.grip_force)
        widths: list[float] = []

        def settled() -> bool:
            widths.append(simulation.gripper_width)
            # the grip force builds up within 0.1 s after the pads have met something
            return len(widths) > 20 and max(widths[-12:]) - min(widths[-12:]) < 1e-4

        self.driver.wait(c.settle_time, self._tick, until=settled)
        left, right = simulation.pad_contacts()
        self.between = tuple(sorted(left & right))
        self.width = simulation.gripper_width

    def _lift(self) -> None:
        self._rise(self.config.lift, self.config.lift_speed)

    def _hold(self) -> None:
        self.driver.wait(self.config.hold_time, self._tick)

    def _shake(self) -> None:
        c = self.config
        R = self.driver.T_desired[:3, :3]

        def offset(axis: FloatArray, t: float) -> FloatArray:
            return axis * shake(t, c.shake_amplitude, c.shake_frequency, c.shake_time)

        # sideways both along and across the closing direction, then up and down
        for axis in ((R[:, 0] + R[:, 1]) / np.sqrt(2), np.array([0.0, 0.0, 1.0])):
            self.driver.follow(partial(offset, axis), c.shake_time, self._tick)
        self.driver.wait(c.settle_after_shake, self._tick)

    def _verdict(self) -> ExecutionResult:
        c, reflex = self.config, self.driver.reflex
        if reflex is not None:
            return ExecutionResult(outcome="reflex", reason=f"{reflex} while in phase {self.phase}")
        left, right = self.simulation.pad_contacts()
        raised = [name for name in self.rest if self._height(name) - self.rest[name] >= c.success_height]
        for name in sorted(left & right):
            if name in raised:
                return ExecutionResult(outcome="success", reason=f"{name} is held", lifted=name)
        if self.between:
            names = ", ".join(self.between)
            return ExecutionResult(outcome="slipped", reason=f"{names} was between the pads and was lost")
        limit = max(c.support_band, self.planned + 0.002)
        if self.contact_height is not None and self.contact_height > limit:
            reason = (
                f"the fingers met something {1e3 * self.contact_height:.1f} mm over the table, "
                f"planned were {1e3 * max(self.planned, 0.0):.1f} mm"
            )
            return ExecutionResult(outcome="collision", reason=reason)
        reason = "nothing stood between the closed pads"
        if raised:
            # a ring on a hook: no grasp, for nothing but luck keeps it there
            reason = f"{', '.join(raised)} came up hanging on the fingers, not between the pads"
        return ExecutionResult(outcome="missed", reason=reason)

    def _pose(self, z: float) -> FloatArray:
        return looking_down([self.grasp.position[0], self.grasp.position[1], z], self.yaw)

    def _rise(self, height: float, speed: float) -> None:
        target = self.driver.T_desired.copy()
        target[2, 3] += height
        self._move(target, speed)

    def _move(self, target: FloatArray, speed: float, until: Callable[[], bool] | None = None) -> bool:
        return self.driver.move_to(
            target, speed, until=until, deceleration=self.config.contact_deceleration, on_tick=self._tick
        )

    def _tick(self, driver: Driver) -> None:
        if self._on_tick is not None:
            self._on_tick(self.phase)

    def _tip(self) -> float:
        return float(self.simulation.T_world_tcp[2, 3]) - hand.FINGERTIP_BEYOND_TCP

    def _height(self, name: str) -> float:
        return float(self.simulation.object_pose(name)[2, 3])


def reachable_yaw(driver: ArmDriver, grasp: Grasp) -> float:
    """Heading of the hand's x axis [rad]: the nearer one, unless only the other is in reach."""
    T = driver.T_desired
    here = float(np.arctan2(T[1, 0], T[0, 0]))
    near = nearest_yaw(grasp.angle + np.pi / 2, here)
    for yaw in (near, near - np.copysign(np.pi, near - here)):
        try:
            driver.ik.solve(driver.q, looking_down(grasp.position, yaw))
        except ConfigError:
            continue
        return float(yaw)
    # out of reach either way: go as far as the protective stop allows and let it say why
    return near
