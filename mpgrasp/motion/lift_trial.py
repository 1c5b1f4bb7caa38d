"""Does a grasp lift? The whole execution by a free-flying hand, thousands of times over.

The policy, the figures and the verdict are those of `execution`; only the arm is missing. Nothing in a
scene moves before the hand first touches something, so the trial begins just above that contact; it ends
when nothing is left to lose, does not wait where nothing creeps, and untouched objects sleep. With and
without the latter three, the same of 90 grasps in random scenes lifted; no no-slip iterations would change 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpgrasp.grasp import Grasp
from mpgrasp.motion.execution import Execution, check_finite
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.hand_driver import HandDriver
from mpgrasp.motion.trajectory import nearest_yaw
from mpgrasp.robot import hand
from mpgrasp.scene.free_hand import FreeGripper
from mpgrasp.scene.scene import Scene

OUTCOMES = ("success", "collision", "missed", "slipped")
"""How a trial can end; a protective stop counts as a collision."""
SCAN_STEP = 0.002
"""Between two looks for the first contact on the way down [m]."""


@dataclass(frozen=True, kw_only=True)
class LiftResult:
    """What came of a trial."""

    outcome: str
    """One of `OUTCOMES`."""
    reason: str
    """The same in a sentence."""
    lifted: str | None = None
    """The object that was lifted, held and shaken."""
    rise: float = 0.0
    """Of the object that rose most between the pads, over its place of rest, at the end [m]."""
    duration: float = 0.0
    """Simulated time [s]."""


class LiftRig:
    """A scene in which grasps are tried, one after the other, each in the untouched scene.

    Args:
        scene: built without the robot.
        config: how grasps are executed and judged.

    Raises:
        ConfigError: the scene has a robot.
    """

    def __init__(self, scene: Scene, config: ExecutionConfig | None = None) -> None:
        self.config = config or ExecutionConfig()
        self._hand = FreeGripper(scene)

    def attempt(self, grasp: Grasp) -> LiftResult:
        """Try a grasp from the settled scene; the result depends on scene, grasp and config alone.

        Raises:
            ConfigError: a grasp that is not finite.
        """
        check_finite(grasp)
        self._hand.reset()
        return _Trial(HandDriver(self._hand), grasp, self.config).lift_result()


class _Trial(Execution):
    """An execution by the free hand that does not wait for what is already decided."""

    def __init__(self, driver: HandDriver, grasp: Grasp, config: ExecutionConfig) -> None:
        self._hand, self._motion, self._lost = driver.simulation, driver.config, False
        # of both headings the one at which the camera looks away from the arm's base, as the arm would
        super().__init__(driver, grasp, config, yaw=nearest_yaw(grasp.angle + np.pi / 2, 0.0))

    def lift_result(self) -> LiftResult:
        result = self.play()
        outcome = "collision" if result.outcome == "reflex" else result.outcome
        names = (result.lifted,) if result.lifted else result.between
        rise = max((self._height(name) - self.rest[name] for name in names), default=0.0)
        return LiftResult(
            outcome=outcome, reason=result.reason, lifted=result.lifted, rise=rise, duration=result.duration
        )

    def _pregrasp(self) -> None:
        c = self.config
        width = float(np.clip(self.grasp.width + c.opening_margin, 0.0, hand.GRIPPER_MAX_WIDTH))
        ready = float(self.grasp.position[2]) + c.approach
        free = self._lowest_free(max(ready, self._hand.top + hand.FINGERTIP_BEYOND_TCP), width)
        above = free > ready
        self._place(free + self._run_up(c.approach_speed if above else c.descent_speed), width)
        if above:
            super()._pregrasp()

    def _lowest_free(self, z: float, width: float) -> float:
        """How far down from z the hand can come without touching anything."""
        bottom = self.planned + hand.FINGERTIP_BEYOND_TCP
        while z > bottom:
            self._place(z - SCAN_STEP, width)
            if self._hand.touches():
                break
            z -= SCAN_STEP
        return z

    def _place(self, z: float, width: float) -> None:
        x, y = self.grasp.position[:2]
        self._hand.place([x, y, z], self.yaw, width)

    def _run_up(self, speed: float) -> float:
        """Way in which the hand is sure to get up to a speed [m]."""
        return speed**2 / self._motion.linear_acceleration + 0.002

    def _close(self) -> None:
        super()._close()
        self._lost = not self.between and self.width < 1e-3

    def _lift(self) -> None:
        if not self._lost:
            super()._lift()
            left, right = self.simulation.pad_contacts()
            self._lost = not left | right

    def _hold(self) -> None:
        if not self._lost:
            # what does not creep by now will not
            self.driver.wait(self.config.hold_time, until=self._holds_still)

    def _holds_still(self) -> bool:
        return bool(self.between) and self._hand.are_still(self.between)

    def _shake(self) -> None:
        if not self._lost:
            super()._shake()
