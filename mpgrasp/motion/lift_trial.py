"""Trials of grasps by a free-flying hand: the whole execution and its verdict, thousands of times over.

The policy, the figures and the verdict are those of `execution`; only the arm is missing. Nothing in a
scene moves before the hand first touches something, so the trial begins just above that contact; it ends
when nothing is left to lose, does not wait where nothing creeps, and untouched objects sleep. With and
without the latter three, the same of 90 grasps in random scenes lifted; no no-slip iterations would change 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mpgrasp.grasp import Grasp
from mpgrasp.motion import phases
from mpgrasp.motion.execution import check_finite
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.execution_state import ExecutionState, Phase
from mpgrasp.motion.hand_driver import HandDriver
from mpgrasp.motion.heading import nearest_yaw
from mpgrasp.motion.phases import PHASES
from mpgrasp.motion.verdict import judge
from mpgrasp.outcome import Outcome
from mpgrasp.robot import hand
from mpgrasp.scene.free_hand import FreeHand
from mpgrasp.scene.scene import Scene

LiftOutcome = Literal[Outcome.SUCCESS, Outcome.COLLISION, Outcome.MISSED, Outcome.SLIPPED]
"""Outcomes that a trial can have; a protective stop counts as a collision."""
SCAN_STEP = 0.002
"""Way between two looks for the first contact on the way down [m]."""


@dataclass(frozen=True, kw_only=True)
class LiftResult:
    """Outcome of a trial."""

    outcome: LiftOutcome
    reason: str
    """The same in a sentence."""
    lifted: str | None = None
    """The object that was lifted, held and shaken."""
    rise: float = 0.0
    """Rise of the object that rose most between the fingers, over its place of rest, at the end [m]."""
    duration: float = 0.0
    """Simulated time [s]."""


class LiftRig:
    """A scene in which grasps are tried, one after the other, each in the untouched scene.

    Args:
        scene: built without the robot.
        config: speeds, forces, times and heights of an execution.

    Raises:
        ConfigError: the scene has a robot.
    """

    def __init__(self, scene: Scene, config: ExecutionConfig | None = None) -> None:
        self.config = config or ExecutionConfig()
        self._hand = FreeHand(scene)

    def attempt(self, grasp: Grasp) -> LiftResult:
        """Try a grasp from the settled scene; the result depends on scene, grasp and config alone.

        Raises:
            ConfigError: a grasp that is not finite.
        """
        check_finite(grasp)
        self._hand.reset()
        driver = HandDriver(self._hand)
        # of both headings the one at which the camera looks away from the arm's base, as the arm would
        yaw = nearest_yaw(grasp.angle + np.pi / 2, 0.0)
        state = ExecutionState(driver, grasp, self.config, yaw=yaw)
        state.play(TrialPhases(driver).by_name)
        result = judge(state)
        names = (result.lifted,) if result.lifted else result.between
        return LiftResult(
            outcome=Outcome.COLLISION if result.outcome is Outcome.REFLEX else result.outcome,
            reason=result.reason,
            lifted=result.lifted,
            rise=max((state.height_of(name) - state.rest[name] for name in names), default=0.0),
            duration=result.duration,
        )


class TrialPhases:
    """Phases of one execution by the free hand, which do not wait for what is already decided."""

    def __init__(self, driver: HandDriver) -> None:
        self._driver, self._hand = driver, driver.simulation
        self._lost = False  # True once nothing is left to lose

    @property
    def by_name(self) -> Mapping[str, Phase]:
        """Phases in order: those of `PHASES`, in place of some of which stand its own."""
        return {
            **PHASES,
            "pregrasp": self.pregrasp,
            "close": self.close,
            "lift": self.lift,
            "hold": self.hold,
            "shake": self.shake,
        }

    def pregrasp(self, state: ExecutionState) -> None:
        """Begin just above the first contact on the way down, or above what stands over the pre-grasp."""
        c = state.config
        width = float(np.clip(state.grasp.width + c.opening_margin, 0.0, hand.GRIPPER_MAX_WIDTH))
        ready = float(state.grasp.position[2]) + c.approach
        free = self._lowest_free(state, max(ready, self._hand.top + hand.FINGERTIP_BEYOND_TCP), width)
        above = free > ready
        run_up = self._run_up(c.approach_speed if above else c.descent_speed)
        self._place(state, free + run_up, width)
        if above:
            phases.pregrasp(state)

    def close(self, state: ExecutionState) -> None:
        """Close the gripper; all is lost where the pads meet."""
        phases.close(state)
        self._lost = not state.between and state.width < 1e-3

    def lift(self, state: ExecutionState) -> None:
        """Lift unless all is lost, as it is where no finger presses anything at the end."""
        if not self._lost:
            phases.lift(state)
            self._lost = not self._hand.finger_forces()

    def hold(self, state: ExecutionState) -> None:
        """Hold unless all is lost, until nothing creeps: what does not by then will not later."""
        if not self._lost:
            between = state.between
            until = (lambda: self._hand.are_still(between)) if between else None
            self._driver.wait(state.config.hold_time, until=until)

    def shake(self, state: ExecutionState) -> None:
        """Shake unless all is lost."""
        if not self._lost:
            phases.shake(state)

    def _lowest_free(self, state: ExecutionState, z: float, width: float) -> float:
        """Lowest height [m] that the hand reaches on its way down from z without touching anything."""
        bottom = state.planned + hand.FINGERTIP_BEYOND_TCP
        while z > bottom:
            self._place(state, z - SCAN_STEP, width)
            if self._hand.touches():
                break
            z -= SCAN_STEP
        return z

    def _place(self, state: ExecutionState, z: float, width: float) -> None:
        x, y = state.grasp.position[:2]
        self._hand.place([x, y, z], state.yaw, width)

    def _run_up(self, speed: float) -> float:
        """Way in which the hand is sure to get up to a speed [m]."""
        return speed**2 / self._driver.config.linear_acceleration + 0.002
