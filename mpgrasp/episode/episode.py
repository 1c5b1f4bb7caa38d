"""One closed-loop grasp attempt: look and move at 10 Hz from z_max to z_min, then grasp, lift, judge.

The scene, the start pose and the sensor noise depend on the seed alone, so that every detector and
every controller meets the same world: the noise of a tick is drawn anew from (seed, tick).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace

import numpy as np

from mpgrasp.controllers.controller import Command, Controller, Observation
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import GraspDetector, reads_colour, reads_truth
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.latency import CommandQueue
from mpgrasp.episode.metrics import ReachMetrics
from mpgrasp.episode.result import EpisodeResult
from mpgrasp.episode.seeds import controller_seed, force_rng, noise_rng
from mpgrasp.episode.stages import StageClock
from mpgrasp.episode.world import World
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.guards.asking import ask_controller, ask_detector, ask_diagnostics, ask_final_grasp
from mpgrasp.linear_algebra import norm
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution import execute_grasp
from mpgrasp.motion.motion_statistics import MotionStatistics
from mpgrasp.outcome import Outcome
from mpgrasp.recording.recorder import NullRecorder, Recorder, TickRecord
from mpgrasp.scene.config import SceneConfig

_TICK_PERIOD = 0.1  # [s], between two records of a recording once the reach is over


def run_episode(
    scene_config: SceneConfig,
    seed: int,
    *,
    detector: GraspDetector,
    controller: Controller,
    config: EpisodeConfig | None = None,
    recorder: Recorder | None = None,
) -> EpisodeResult:
    """Play one episode from the settled scene to the verdict of physics.

    Args:
        scene_config: what is on the table.
        seed: of the scene, the start pose and the sensor noise; 0 is a seed.
        detector: is reset, then asked once a tick.
        controller: is reset, then asked once a tick.
        config: how the episode runs.
        recorder: is shown every tick.

    Raises:
        ConfigError: a scene that cannot be built.
        CameraError: a camera backend that this machine does not have, or that has no colour for a detector
            that reads it.
        PlugInError: what the detector or the controller returned cannot be used.
    """
    episode = Episode(scene_config, seed, detector=detector, config=config, recorder=recorder)
    try:
        controller.reset(controller_seed(seed))
        return episode.conclude(reach(episode, controller))
    finally:
        episode.close()


def reach(episode: Episode, controller: Controller) -> Grasp | None:
    """Look and move under a controller until it is done, and return its grasp; None if it was interrupted."""
    while episode.interruption() is None:
        observation = episode.look()
        with episode.timed("control"):
            command = ask_controller(controller, observation)
        episode.act(command, ask_diagnostics(controller))
        if command.done:
            break
    return ask_final_grasp(controller) if episode.interruption() is None else None


class Episode:
    """One attempt, taken tick by tick: look and act in turn, then conclude.

    `run_episode` steps it with a controller, `mpgrasp.env` with whatever a learner decides, and
    `mpgrasp.episode.clearing` takes several attempts in one world: `attempt` and `begin` in turn.

    Args:
        scene_config: what is on the table.
        seed: of the scene, the start pose and the sensor noise.
        detector: is reset here, then asked at every look.
        config: how the episode runs.
        recorder: is shown every tick.
    """

    def __init__(
        self,
        scene_config: SceneConfig,
        seed: int,
        *,
        detector: GraspDetector,
        config: EpisodeConfig | None = None,
        recorder: Recorder | None = None,
    ) -> None:
        self.config, self.seed, self.detector = config or EpisodeConfig(), seed, detector
        self.recorder = recorder or NullRecorder()
        self.world = World(scene_config, seed, self.config, colour=reads_colour(detector))
        self.scene, self.simulation = self.world.scene, self.world.simulation
        self.camera, self.driver = self.world.camera, self.world.driver
        self.ticks = 0
        """Control ticks, of all attempts."""
        self.frame: DepthFrame | None = None
        """Image of the last look."""
        self._grasp_map: GraspMap | None = None
        self._detect_seconds = 0.0
        self._clock = StageClock()
        self._last_record = -np.inf
        self.recorder.start(self.simulation)
        self.begin()

    def begin(self) -> None:
        """Start an attempt from where the arm rests: its clock, its metrics and the truth anew."""
        self.driver.reset()
        self.start_time, self._first_tick = self.simulation.time, self.ticks
        self.metrics = ReachMetrics()
        self._commands = CommandQueue()
        self._grasp: Grasp | None = None
        self._reason = ""
        truth = reads_truth(self.detector)
        self.detector.reset(self.scene.height_map(data=self.simulation.data) if truth else None)

    def look(self) -> Observation:
        """Return the view of this tick; its noise depends on seed and tick alone, not on earlier looks."""
        with self.timed("render"):
            self.frame = self.camera.capture(self.simulation.data, noise_rng(self.seed, self.ticks))
        clock = time.perf_counter()
        self._grasp_map = self._detect(self.frame)
        self._detect_seconds = time.perf_counter() - clock
        self._clock.add("detect", self._detect_seconds)
        time_s = self.simulation.time - self.start_time
        self.metrics.look(time_s, self._grasp_map)
        return Observation(
            time=time_s,
            T_world_tcp=self.simulation.T_world_tcp,
            grasp_map=self._grasp_map,
        )

    def act(self, command: Command, diagnostics: Mapping[str, FloatArray | float | bool]) -> None:
        """Follow a command until the next tick, or what was decided before as long as the latency lasts.

        Of a command that is done, nothing but the gripper moves.
        """
        self.ticks += 1
        before, dt = self.driver.statistics(), self.driver.config.dt
        for acting, ticks in self._commands.spans(command, self._delay(), round(self.config.control_dt / dt)):
            if acting is not None:
                self.simulation.open_gripper(acting.gripper)
            twist = np.zeros(6) if acting is None else acting.twist
            self.driver.drive(twist, ticks * dt, self.metrics.tick)
        if command.done:
            self.simulation.open_gripper(command.gripper)
        else:
            after = self.driver.statistics()
            self._clock.add("ik", after.ik_seconds - before.ik_seconds)
            self._clock.add("physics", after.physics_seconds - before.physics_seconds)
        self._record("reach", self.frame, self._grasp_map, diagnostics, command)

    def interruption(self) -> Outcome | None:
        """Return what ended the reach before a grasp, if anything: reflex or timeout."""
        if self.driver.reflex is not None:
            return Outcome.REFLEX
        late = self.simulation.time - self.start_time >= self.config.max_reach_time
        return Outcome.TIMEOUT if late else None

    def conclude(self, grasp: Grasp | None) -> EpisodeResult:
        """Execute the grasp, unless the reach was interrupted, judge, and end the recording."""
        result = self.attempt(grasp)
        self.recorder.finish(self._verdict(result.outcome))
        return result

    def attempt(self, grasp: Grasp | None) -> EpisodeResult:
        """Execute the grasp, unless the reach was interrupted, and judge."""
        reach = self.driver.statistics()
        outcome, lifted = self.interruption(), None
        if outcome is None and grasp is None:
            outcome = Outcome.NO_GRASP
        elif outcome is None and grasp is not None:
            self._grasp = grasp
            execution = execute_grasp(
                self.driver,
                grasp,
                self.config.execution,
                on_tick=self.record_motion,
                rng=force_rng(self.seed, self.ticks),
            )
            outcome, lifted = Outcome(execution.outcome), execution.lifted
            self._reason = execution.reason
        assert outcome is not None
        return self._result(outcome, lifted, reach)

    def record_motion(self, phase: str, driver: ArmDriver) -> None:
        """Show the recorder a tick of a motion that is no reach, as often as one of a reach."""
        if self.simulation.time - self._last_record >= _TICK_PERIOD - 1e-6:
            self._record(phase, None, None, {})

    def timed(self, stage: str) -> AbstractContextManager[None]:
        """Count the wall time of a `with` block to one of `STAGES`."""
        return self._clock.timed(stage)

    def timing(self) -> dict[str, float]:
        """Return the median wall time of each stage of a tick so far [ms]."""
        return self._clock.medians()

    def close(self) -> None:
        """Free the camera."""
        self.world.close()

    def _detect(self, frame: DepthFrame) -> GraspMap:
        """Return what the detector finds, where the camera is believed to be.

        A detector that knows the world's shape is told the true pose, and so errs by the calibration as well.
        """
        if not reads_truth(self.detector) or self.camera.errors.calibration is None:
            return ask_detector(self.detector, frame)
        true = replace(frame, T_world_camera=self.camera.pose(self.simulation.data))
        return replace(ask_detector(self.detector, true), T_world_camera=frame.T_world_camera)

    def _delay(self) -> int:
        """Time after which what was seen last acts [ticks of the velocity loop]."""
        latency = self.config.camera.latency
        return round((self._detect_seconds if latency == "measured" else latency) / self.driver.config.dt)

    def _result(self, outcome: Outcome, lifted: str | None, reach: MotionStatistics) -> EpisodeResult:
        whole = self.driver.statistics()
        return EpisodeResult(
            outcome=outcome,
            object=lifted or self._target(),
            sim_time_s=self.simulation.time - self.start_time,
            ticks=self.ticks - self._first_tick,
            reflex=self.driver.reflex,
            min_singular_value=whole.min_singular_value,
            near_singularity_s=whole.near_singularity,
            path_length_m=reach.path_length,
            jerk_rms=reach.jerk_rms,
            spectral_arc_length=self.metrics.spectral_arc_length,
            first_detection_s=self.metrics.first_detection_s,
            blind_drift_m=self.metrics.blind_drift_m,
            grasp=self._grasp,
            timing=self.timing(),
            state_hash=self.simulation.state_hash(),
        )

    def _target(self) -> str:
        """Return the object nearest to the chosen grasp; the scene's first where there is none."""
        if self._grasp is None:
            return self.scene.objects[0]
        position = self._grasp.position[:2]
        return min(
            self.scene.objects,
            key=lambda name: norm(self.simulation.object_pose(name)[:2, 3] - position),
        )

    def _verdict(self, outcome: Outcome) -> str:
        reason = str(self.driver.reflex) if outcome is Outcome.REFLEX else self._reason
        return f"{outcome}: {reason}" if reason else str(outcome)

    def _record(
        self,
        phase: str,
        frame: DepthFrame | None,
        grasp_map: GraspMap | None,
        diagnostics: Mapping[str, FloatArray | float | bool],
        command: Command | None = None,
    ) -> None:
        self._last_record = self.simulation.time
        driver = self.driver
        self.recorder.tick(
            TickRecord(
                phase=phase,
                simulation=self.simulation,
                frame=frame,
                grasp_map=grasp_map,
                diagnostics=diagnostics,
                twist_commanded=driver.twist_commanded,
                twist_achieved=driver.twist_achieved,
                min_singular_value=driver.min_singular_value,
                manipulability=driver.manipulability,
                grasp=self._grasp,
                event=None if driver.reflex is None else str(driver.reflex),
                command=command,
            )
        )
