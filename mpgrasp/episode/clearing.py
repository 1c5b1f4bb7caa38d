"""A table to be cleared (the paper's Table VI): pick, carry to the basket, drop, return, over and over.

Every attempt is one of `Episode`, with the same detector and controller in closed loop, from the same
start. It is judged by physics: what it lifted must lie in the basket when the arm is back. Simulated time
counts, that of failures and of recovering from protective stops included.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from mpgrasp.controllers.controller import Controller, remember_failures
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.episode.basket import DROPS, Basket
from mpgrasp.episode.config import ClearingConfig
from mpgrasp.episode.episode import Episode, reach
from mpgrasp.episode.result import ClearingResult, EpisodeResult, Pick
from mpgrasp.episode.seeds import controller_seed
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import Grasp
from mpgrasp.guards.asking import ask_final_grasp
from mpgrasp.motion.arm_driver import OnTick
from mpgrasp.motion.reflex import Reflex
from mpgrasp.motion.trajectory import path_profile
from mpgrasp.outcome import Outcome
from mpgrasp.recording.recorder import Recorder
from mpgrasp.scene.config import SceneConfig
from mpgrasp.workspace import WORKSPACE_CENTRE, WORKSPACE_REACH

FALLEN = -0.02
"""An object whose frame lies lower than this over the table has fallen off it [m]."""
CONTACT = 12.0
"""Force at which the hand opens above the basket because it is on something [N]: more than things weigh."""
GUIDED_RATE = 0.5
"""Speed of the fastest joint when the arm is guided home [rad/s]."""
FAILED_GRASPS = (Outcome.COLLISION, Outcome.MISSED, Outcome.SLIPPED, Outcome.REFLEX)
"""Endings after which the object is still where it was grasped at, more or less."""


def run_clearing(
    scene_config: SceneConfig,
    seed: int,
    *,
    detector: GraspDetector,
    controller: Controller,
    config: ClearingConfig | None = None,
    recorder: Recorder | None = None,
) -> ClearingResult:
    """Play one episode until nothing is left on the table, the time is up or nothing more is found.

    Args:
        scene_config: what is on the table; with a basket.
        seed: of the scene, the start pose and the sensor noise; 0 is a seed.
        detector: is reset before every attempt, with the truth of that moment where it reads it.
        controller: is reset before every attempt. One that has `remember_failure(position)` is then
            told where grasps have failed, or reaches were stopped, since the last success, oldest first.
        config: how the episode runs.
        recorder: is shown everything.

    Raises:
        ConfigError: a scene without a basket, or one that cannot be built.
        CameraError: a camera backend that this machine does not have, or that has no colour for a detector
            that reads it.
        PlugInError: what the detector or the controller returned cannot be used.
    """
    config = config or ClearingConfig()
    require_basket(scene_config)
    episode = Episode(scene_config, seed, detector=detector, config=config, recorder=recorder)
    try:
        return Clearing(episode, controller, config).play()
    finally:
        episode.close()


def require_basket(scene_config: SceneConfig) -> None:
    """Raise ConfigError unless there is a basket to carry things to."""
    if not scene_config.basket:
        raise ConfigError("nowhere to carry things to", got="basket = false", allowed="basket = true")


class Clearing:
    """One clearing, attempt by attempt.

    Args:
        episode: a fresh one, with the arm at its start.
        controller: picks where to go and what to grasp.
        config: how the table is cleared.
    """

    def __init__(self, episode: Episode, controller: Controller, config: ClearingConfig) -> None:
        self.episode, self.controller, self.config = episode, controller, config
        self.basket = Basket(episode.scene)
        self.picks: list[Pick] = []
        self.stops: list[Reflex] = []
        self._start_time = episode.simulation.time
        self._attempt_start = 0.0
        self._T_start, self._q_start = episode.driver.T_desired.copy(), episode.driver.q.copy()
        self._failed_at: list[FloatArray] = []
        self._blind = self._drops = 0
        self._min_singular_value, self._near = np.inf, 0.0

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self.episode.simulation.time - self._start_time

    def play(self) -> ClearingResult:
        """Play attempt after attempt, to the end.

        Whoever steers by other means calls `begin` and `take` in turn, until there is an `ending`.
        """
        while (outcome := self.ending()) is None:
            self.begin()
            self.take(reach(self.episode, self.controller))
        return self.conclude(outcome)

    def begin(self) -> None:
        """Start an attempt: the controller anew, and told where grasps have failed."""
        if self.picks:
            self.episode.begin()
        self._attempt_start = self.time
        self.controller.reset(controller_seed(self.episode.seed, len(self.picks)))
        remember_failures(self.controller, self._failed_at)

    def take(self, grasp: Grasp | None) -> Pick:
        """End the attempt: execute its grasp, unless it was interrupted, carry what is held, and return."""
        episode, driver = self.episode, self.episode.driver
        result = episode.attempt(grasp)
        if result.success:
            self._carry()
            if driver.reflex is not None:
                result = replace(result, outcome=Outcome.REFLEX, reflex=driver.reflex)
        self._return()
        if result.success and result.object not in self._whereabouts()[0]:
            result = replace(result, outcome=Outcome.DROPPED)
        self._learn(result)
        self._tally()
        pick = Pick(result=result, start_s=self._attempt_start, end_s=self.time)
        self.picks.append(pick)
        return pick

    def conclude(self, outcome: Outcome) -> ClearingResult:
        """Return what came of it, and end the recording."""
        in_basket, knocked_off, left = self._whereabouts()
        text = f"{outcome}: {len(in_basket)} in the basket, {len(left)} left, {len(knocked_off)} knocked off"
        self.episode.recorder.finish(text)
        return ClearingResult(
            outcome=outcome,
            picks=tuple(self.picks),
            in_basket=in_basket,
            knocked_off=knocked_off,
            left=left,
            sim_time_s=self.time,
            time_limit_s=self.config.time_limit,
            ticks=self.episode.ticks,
            stops=tuple(self.stops),
            min_singular_value=self._min_singular_value,
            near_singularity_s=self._near,
            timing=self.episode.timing(),
            state_hash=self.episode.simulation.state_hash(),
        )

    def ending(self) -> Outcome | None:
        """Return what ends the clearing, if anything does: nothing left, no time, or nothing found."""
        if self.time > self.config.time_limit:
            return Outcome.TIMEOUT
        _, knocked_off, left = self._whereabouts()
        if not left:
            return Outcome.KNOCKED_OFF if knocked_off else Outcome.SUCCESS
        return Outcome.NO_GRASP if self._blind >= self.config.blind_attempts else None

    def _whereabouts(self) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
        """Return the names of the objects in the basket, lost, and still to be picked."""
        places: tuple[list[str], list[str], list[str]] = ([], [], [])
        for name in self.episode.scene.objects:
            position = self.episode.simulation.object_pose(name)[:3, 3]
            away = float(np.abs(position[:2] - WORKSPACE_CENTRE).max())
            lost = position[2] < FALLEN or away > WORKSPACE_REACH
            places[0 if self.basket.holds(position) else 1 if lost else 2].append(name)
        return tuple(places[0]), tuple(places[1]), tuple(places[2])

    def _carry(self) -> None:
        """Take what is in the hand to the basket and let go of it."""
        episode, driver, c = self.episode, self.episode.driver, self.config
        self._rise("carry")
        spot = self.basket.centre + DROPS[self._drops % len(DROPS)]
        self._drops += 1
        # heading of the start: long things, grasped across, lie along the basket
        target = looking_down([*spot, c.carry_height])
        driver.move_to(target, c.carry_speed, on_tick=self._showing("carry"))
        target[2, 3] = c.drop_height
        driver.move_to(
            target, c.lower_speed, until=lambda: driver.touch > CONTACT, on_tick=self._showing("carry")
        )
        if driver.reflex is None:
            episode.simulation.open_gripper()
            driver.wait(c.drop_time, self._showing("drop"))

    def _return(self) -> None:
        """Bring the arm back to its start: where protective stops do not let it, joint by joint."""
        simulation, driver = self.episode.simulation, self.episode.driver
        for _ in range(2):
            if driver.reflex is not None:
                self._recover()
            simulation.open_gripper()
            if driver.T_desired[2, 3] < self.config.drop_height:
                self._rise("return")  # the hand may stand between objects
            driver.move_to(self._T_start, on_tick=self._showing("return"))
            if driver.reflex is None:
                return
        self._recover()
        self._guide_home()

    def _recover(self) -> None:
        """Stand still for as long as a stop costs, then take the arm over again where it is."""
        driver = self.episode.driver
        assert driver.reflex is not None
        self.stops.append(driver.reflex)
        self._tally()
        for _ in range(round(self.config.recovery_time / driver.config.dt)):
            self._step("recover")
        driver.reset()

    def _guide_home(self) -> None:
        """Turn all joints back to the start at once, as somebody's hand would: no limit watches this."""
        driver = self.episode.driver
        q, way = driver.q, self._q_start - driver.q
        done = 0.0
        for share in path_profile(0.0, float(np.abs(way).max()), driver.config, 1.0, GUIDED_RATE):
            self.episode.simulation.set_arm_target(q + way * share, way * (share - done) / driver.config.dt)
            done = share
            self._step("recover")
        driver.reset()

    def _step(self, phase: str) -> None:
        """One tick of the velocity loop in which the driver has no say."""
        driver = self.episode.driver
        self.episode.simulation.step(driver.steps_per_tick)
        self._showing(phase)(driver)

    def _rise(self, phase: str) -> None:
        target = self.episode.driver.T_desired.copy()
        target[2, 3] = max(target[2, 3], self.config.carry_height)
        self.episode.driver.move_to(target, self.config.carry_speed, on_tick=self._showing(phase))

    def _learn(self, result: EpisodeResult) -> None:
        """Keep what the next attempt is to know."""
        if result.outcome is Outcome.NO_GRASP:
            self._blind += 1
        else:
            self._blind = 0
        if result.outcome in FAILED_GRASPS:
            self._failed_at.append(self._aim() if result.grasp is None else result.grasp.position)
        elif result.outcome in (Outcome.SUCCESS, Outcome.DROPPED, Outcome.NO_GRASP):
            # the scene is another one, or nothing else is there to be tried
            self._failed_at.clear()

    def _aim(self) -> FloatArray:
        """Point (3,) that a stopped reach was about [m]: its grasp so far, or the place under the camera."""
        grasp, frame = ask_final_grasp(self.controller), self.episode.frame
        if grasp is not None:
            return grasp.position
        assert frame is not None, "a reach looks before it moves"
        return np.append(frame.T_world_camera[:2, 3], 0.0)

    def _tally(self) -> None:
        """Keep what the driver has measured since its last reset."""
        measured = self.episode.driver.statistics()
        self._min_singular_value = min(self._min_singular_value, measured.min_singular_value)
        self._near += measured.near_singularity

    def _showing(self, phase: str) -> OnTick:
        return partial(self.episode.record_motion, phase)
