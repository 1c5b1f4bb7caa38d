"""Does a grasp lift? The whole execution by a free-flying hand, thousands of times over.

The policy, the figures and the verdict are those of `execution`; only the arm is missing. Nothing in a
scene moves before the hand first touches something, so the trial begins just above that contact; it ends
when nothing is left to lose, does not wait where nothing creeps, and untouched objects sleep. With and
without the latter three, the same of 90 grasps in random scenes lifted; no no-slip iterations would change 5.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mpgrasp import panda
from mpgrasp.execution import Execution, check_finite
from mpgrasp.execution_config import ExecutionConfig
from mpgrasp.free_gripper import FreeGripper
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp
from mpgrasp.motion import FORCE_WINDOW
from mpgrasp.reflex import Reflex, ReflexConfig
from mpgrasp.scene import Scene
from mpgrasp.trajectory import MotionConfig, nearest_yaw, path_profile

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


class HandDriver:
    """Moves the hand as `ArmDriver` moves the arm, with the same profiles and the same stop on force."""

    def __init__(self, hand: FreeGripper) -> None:
        self.simulation = hand
        self.config = MotionConfig()
        self.bounds = ReflexConfig()
        self.reflex: Reflex | None = None
        self._steps = round(self.config.dt / hand.model.opt.timestep)
        self._forces: deque[FloatArray] = deque([np.zeros(3)] * FORCE_WINDOW, maxlen=FORCE_WINDOW)

    @property
    def T_desired(self) -> FloatArray:
        """Pose (4, 4) at which the tool point should be."""
        return self.simulation.T_desired

    @property
    def touch(self) -> float:
        """External force on the hand over the last tick [N]."""
        return float(np.linalg.norm(self._forces[-1]))

    def move_to(
        self,
        T_world_tcp: FloatArray,
        max_speed: float,
        *,
        until: Callable[[], bool] | None = None,
        deceleration: float | None = None,
        on_tick: object = None,
    ) -> bool:
        """Move in a straight line, without turning; as `ArmDriver.move_to`."""
        c = self.config
        start = self.T_desired[:3, 3]
        way = T_world_tcp[:3, 3] - start
        done = 0.0
        for share in path_profile(float(np.linalg.norm(way)), 0.0, c, max_speed, c.max_rotation):
            self._tick(start + share * way)
            if self.reflex is not None:
                return False
            if until is not None and until():
                self._brake(way * (share - done) / c.dt, deceleration or c.linear_acceleration)
                return False
            done = share
        return True

    def wait(
        self, duration: float, on_tick: object = None, *, until: Callable[[], bool] | None = None
    ) -> None:
        """Stand still for a time [s], or until something holds."""
        here = self.T_desired[:3, 3]
        for _ in range(round(duration / self.config.dt)):
            if self.reflex is not None or (until is not None and until()):
                break
            self._tick(here)

    def follow(self, path: Callable[[float], FloatArray], duration: float, on_tick: object = None) -> None:
        """Follow offsets (3,) [m] of the tool point as a function of time [s]."""
        start = self.T_desired[:3, 3]
        for k in range(1, round(duration / self.config.dt) + 1):
            if self.reflex is not None:
                break
            self._tick(start + path(k * self.config.dt))

    def _brake(self, velocity: FloatArray, deceleration: float) -> None:
        dt = self.config.dt
        speed = float(np.linalg.norm(velocity))
        while speed > 0 and self.reflex is None:
            slower = max(0.0, speed - deceleration * dt)
            velocity, speed = velocity * (slower / speed), slower
            self._tick(self.T_desired[:3, 3] + velocity * dt)

    def _tick(self, target: FloatArray) -> None:
        hand, b = self.simulation, self.bounds
        hand.step(target, self._steps)
        self._forces.append(hand.external_force)
        force = float(np.linalg.norm(sum(self._forces))) / FORCE_WINDOW
        for limit, value, bound in (
            ("contact_force", force, b.contact_force),
            ("tracking_position", hand.lag, b.tracking_position),
        ):
            if value > bound:
                self.reflex = Reflex(limit=limit, joint=None, value=value, bound=bound, time=hand.time)


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
        width = float(np.clip(self.grasp.width + c.opening_margin, 0.0, panda.GRIPPER_MAX_WIDTH))
        ready = float(self.grasp.position[2]) + c.approach
        free = self._lowest_free(max(ready, self._hand.top + panda.FINGERTIP_BEYOND_TCP), width)
        above = free > ready
        self._place(free + self._run_up(c.approach_speed if above else c.descent_speed), width)
        if above:
            super()._pregrasp()

    def _lowest_free(self, z: float, width: float) -> float:
        """How far down from z the hand can come without touching anything."""
        bottom = self.planned + panda.FINGERTIP_BEYOND_TCP
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
