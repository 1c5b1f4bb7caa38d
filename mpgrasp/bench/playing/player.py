"""Plays one episode of a plan at a time and returns its line."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from typing import Any

import msgspec

from mpgrasp.bench.playing.cast import Cast
from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.trace_recorder import TraceRecorder
from mpgrasp.bench.record import ErrorLine, PlayedLine, Task, line_of
from mpgrasp.controllers.controller import remembers_failures
from mpgrasp.detectors.detector import prepare, reads_colour
from mpgrasp.exceptions import ConfigError, MpgraspError, OutputError, PlugInError
from mpgrasp.recording.recorder import NullRecorder, Recorder, TeeRecorder
from mpgrasp.suite import episode_seed

EPISODE = "episode"
"""Key of an episode's wall time in the `timing` of its line."""

RunEpisode = Callable[..., Any]
"""Called like `mpgrasp.episode.episode.run_episode`; returns what has `as_record()`."""

Games = RunEpisode | Mapping[str, RunEpisode]
"""Functions that play an episode, one for all trials or one by trial."""


class EpisodeError(MpgraspError):
    """An episode that could not be played to its end, by a fault in a detector, controller or mpgrasp."""

    @property
    def certain(self) -> bool:
        """True if another attempt would end in the same way: what was returned cannot be used."""
        return isinstance(self.__cause__, PlugInError)


class Player:
    """Plays episodes one at a time with detectors and controllers that are made once for their settings.

    Raises:
        ConfigError, WeightsError: a detector, controller or setting that cannot be used.
    """

    def __init__(self, plan: Plan, run_episode: Games | None = None) -> None:
        self.plan = plan
        self._cast = Cast(plan)
        self.detectors = {name: self._cast.detector(name, plan.suites[0].name) for name in plan.detectors}
        """Those that play the first suite, by name."""
        self.controllers = {
            name: self._cast.controller(name, plan.suites[0].name) for name in plan.controllers
        }
        """The same of the controllers."""
        self.episode_configs = {
            suite.name: suite.episode_config(camera=plan.camera, noise=plan.noise) for suite in plan.suites
        }
        self._run_episode = run_episode or real_games()
        self.lost: list[str] = []
        """Recordings and traces of the last episode that could not be written, and why."""

    def prepare(self) -> list[str]:
        """Have networks compiled now, once for all workers; lines for people about that and about who plays.

        Raises:
            PlugInError: a detector that cannot get ready.
            ConfigError: settings of a later suite that a plug-in refuses, or a detector that reads colour
                with a camera that has none.
        """
        from mpgrasp.camera.wrist_camera import has_colour

        self._cast.rehearse()
        for name, detector in self.detectors.items():
            if reads_colour(detector) and not has_colour(self.plan.camera):
                raise ConfigError(
                    f"{name} reads colour, which takes OpenGL", got=f"camera {self.plan.camera}", allowed="gl"
                )
        ready = [line for line in map(prepare, self.detectors.values()) if line]
        return ready + self._forgetful()

    def play(self, task: Task, watching: Recorder | None = None) -> PlayedLine:
        """The line of one episode, to go to episodes.jsonl.

        What cannot be written of its recordings is told in `lost`, and takes nothing from the line.

        Args:
            task: which episode.
            watching: is shown every tick, beside the plan's own recorders.

        Raises:
            EpisodeError: something went wrong on the way; it is the cause.
        """
        self.lost, clock = [], time.perf_counter()
        suite, games, trace = self.plan.suite(task.suite), self._run_episode, self._trace(task)
        run_episode = games if callable(games) else games[suite.trial]
        try:
            with redirect_stdout(sys.stderr):  # standard output is for results, whatever a plug-in prints
                result = run_episode(
                    suite.scene_config(task.episode),
                    episode_seed(suite.name, self.plan.seed, task.episode),
                    detector=self._cast.detector(task.detector, task.suite),
                    controller=self._cast.controller(task.controller, task.suite),
                    config=self.episode_configs[suite.name],
                    recorder=self._recorder(task, trace, watching),
                )
            line = line_of({**result.as_record(), **_which(self.plan, task)})
            assert not isinstance(line, ErrorLine), "no episode ends with the outcome of an error row"
            self._save(trace, line)
        except (Exception, SystemExit) as error:  # a plug-in that exits must not end the run
            raise EpisodeError(f"{task} broke off: {type(error).__name__}: {error}") from error
        timing = {**line.timing, EPISODE: 1e3 * (time.perf_counter() - clock)}
        return msgspec.structs.replace(line, timing=timing)

    def _forgetful(self) -> list[str]:
        """Return a line for people on each controller that will try what has failed again and again."""
        if not any(suite.trial == "clear" for suite in self.plan.suites):
            return []
        return [
            f"note: {name} has no remember_failure(position): where a grasp failed it may try the same again"
            for name, controller in self.controllers.items()
            if not remembers_failures(controller)
        ]

    def _trace(self, task: Task) -> TraceRecorder | None:
        folder = self.plan.traces
        return None if folder is None else TraceRecorder(folder, self.plan.camera)

    def _save(self, trace: TraceRecorder | None, line: PlayedLine) -> None:
        try:
            if trace is not None:
                trace.save(line)
        except OutputError as error:
            self._lose(error)

    def _lose(self, error: OutputError) -> None:
        self.lost.append(str(error))

    def _recorder(self, task: Task, trace: TraceRecorder | None, watching: Recorder | None) -> Recorder:
        own: list[Recorder] = [recorder for recorder in (trace, watching) if recorder is not None]
        if self.plan.recordings is None or task.episode >= self.plan.record:
            return TeeRecorder(*own) if len(own) > 1 else own[0] if own else NullRecorder()
        from mpgrasp.recording.film import FilmConfig, FilmRecorder
        from mpgrasp.recording.recorder import LenientRecorder
        from mpgrasp.recording.rerun import RerunRecorder

        stem = self.plan.recordings / task.stem
        config = FilmConfig(backend=self.plan.camera)
        makers: list[Callable[[], Recorder]] = [
            lambda: RerunRecorder(f"{stem}.rrd"),
            lambda: FilmRecorder(f"{stem}.gif", f"{stem}.mp4", config=config),
        ]
        recorders = [LenientRecorder(make, self._lose) for make in makers]
        return TeeRecorder(*recorders, *own)


def loss_note(task: Task, lost: Sequence[str]) -> str:
    """Return a sentence about an episode of whose recordings something was lost."""
    return f"{task} counts, but of its recordings is lost: {' | '.join(lost)}"


def error_line(plan: Plan, task: Task, troubles: Sequence[tuple[str, str]]) -> ErrorLine:
    """The line of an episode that could not be played.

    Args:
        plan: that it belongs to.
        task: which episode it is.
        troubles: one (what went wrong, traceback) per attempt.
    """
    reports = [f"attempt {k}: {what}\n\n{trace}" for k, (what, trace) in enumerate(troubles, 1)]
    return ErrorLine(error=troubles[-1][0], traceback="\n".join(reports), **_which(plan, task))


def real_games() -> Games:
    """The functions that play real episodes, by trial; loads MuJoCo."""
    from mpgrasp.episode.clearing import run_clearing
    from mpgrasp.episode.episode import run_episode

    return {"grasp": run_episode, "clear": run_clearing}


def _which(plan: Plan, task: Task) -> dict[str, Any]:
    return {
        "suite": task.suite,
        "seed": plan.seed,
        "scene_seed": episode_seed(task.suite, plan.seed, task.episode),
        "episode": task.episode,
        "detector": task.detector,
        "controller": task.controller,
    }
