"""Plays the episodes of a plan, in this process or in several, and hands over their lines in order.

Episode by episode, every cell (detector, controller) plays in turn, so that a run that is stopped
half-way still compares its cells over the same episodes. Lines come in the plan's order whatever the
number of workers, and say the same.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mpgrasp.bench.plugins import load_controller, load_detector
from mpgrasp.bench.suite import Suite, episode_seed
from mpgrasp.exceptions import ConfigError, MpgraspError
from mpgrasp.recording import NullRecorder, Recorder

CAMERA_BACKENDS = ("auto", "gl", "ray")

Line = dict[str, Any]
RunEpisode = Callable[..., Any]
"""Called like `mpgrasp.episode.run_episode`; returns what has `as_record()`."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """One episode of one cell."""

    episode: int
    detector: str
    controller: str

    @property
    def stem(self) -> str:
        """File name, without ending, of what is recorded of this episode."""
        name = f"{self.detector}-{self.controller}-{self.episode:04d}"
        return re.sub(r"[^A-Za-z0-9._-]+", "-", name)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """All that decides what a run does."""

    suite: Suite
    detectors: tuple[str, ...] = ("dhrnet",)
    """Registry names or import paths."""
    controllers: tuple[str, ...] = ("mppc",)
    """Registry names or import paths."""
    weights: Mapping[str, Path] = field(default_factory=dict)
    """Weights files by detector; the others take what ships with mpgrasp."""
    episodes: int = 10
    """Episodes of each cell."""
    seed: int = 0
    camera: str = "auto"
    """Camera backend: auto, gl (rasterised) or ray (ray-cast, needs no OpenGL)."""
    noise: bool = True
    """Whether the depth camera is as noisy as a real one."""
    record: int = 0
    """Number of episodes of each cell that are recorded, the first ones."""
    recordings: Path | None = None
    """Folder of the recordings."""

    def __post_init__(self) -> None:
        for name, value, least in (("episodes", self.episodes, 1), ("seed", self.seed, 0)):
            if value < least:
                raise ConfigError(f"{name} out of range", got=value, allowed=f"{least} or more")
        if self.record < 0:
            raise ConfigError("record out of range", got=self.record, allowed="0 or more")
        if self.camera not in CAMERA_BACKENDS:
            raise ConfigError("unknown camera backend", got=self.camera, allowed=CAMERA_BACKENDS)
        for kind, names in (("detector", self.detectors), ("controller", self.controllers)):
            if not names or not all(names) or len(set(names)) < len(names):
                raise ConfigError(
                    f"unusable list of {kind}s", got=",".join(names), allowed=f"different {kind}s"
                )
        for name in self.weights:
            if name not in self.detectors:
                raise ConfigError(
                    "weights for a detector that does not run", got=name, allowed=self.detectors
                )

    def tasks(self) -> list[Task]:
        """Every episode of every cell, in the order in which they are played."""
        return [
            Task(episode=episode, detector=detector, controller=controller)
            for episode in range(self.episodes)
            for detector in self.detectors
            for controller in self.controllers
        ]


class EpisodeError(MpgraspError):
    """An episode that could not be played to its end, by a fault in a detector, controller or mpgrasp."""


class Player:
    """Plays episodes one at a time with detectors and controllers that are made once.

    Raises:
        ConfigError, WeightsError: a detector, controller or setting that cannot be used.
    """

    def __init__(self, plan: Plan, run_episode: RunEpisode | None = None) -> None:
        self.plan = plan
        self.detectors = {name: load_detector(name, plan.weights.get(name)) for name in plan.detectors}
        self.controllers = {name: load_controller(name) for name in plan.controllers}
        self.episode_config = plan.suite.episode_config(camera=plan.camera, noise=plan.noise)
        self._run_episode = run_episode or _real_run_episode()

    def play(self, task: Task) -> Line:
        """The line of one episode, to go to episodes.jsonl.

        Raises:
            EpisodeError: something went wrong on the way that is not an mpgrasp error; it is the cause.
        """
        suite = self.plan.suite
        seed = episode_seed(suite.name, self.plan.seed, task.episode)
        try:
            result = self._run_episode(
                suite.scene_config(task.episode),
                seed,
                detector=self.detectors[task.detector],
                controller=self.controllers[task.controller],
                config=self.episode_config,
                recorder=self._recorder(task),
            )
            record = result.as_record()
        except MpgraspError:
            raise
        except Exception as error:
            raise EpisodeError(
                f"episode {task.episode} ({task.detector}, {task.controller}) broke off: "
                f"{type(error).__name__}: {error}"
            ) from error
        return {
            **record,
            "suite": suite.name,
            "seed": self.plan.seed,
            "scene_seed": seed,
            "episode": task.episode,
            "detector": task.detector,
            "controller": task.controller,
        }

    def _recorder(self, task: Task) -> Recorder:
        if self.plan.recordings is None or task.episode >= self.plan.record:
            return NullRecorder()
        from mpgrasp.film import FilmConfig, FilmRecorder
        from mpgrasp.recording import TeeRecorder
        from mpgrasp.rerun_recorder import RerunRecorder

        stem = self.plan.recordings / task.stem
        film = FilmRecorder(f"{stem}.gif", config=FilmConfig(backend=self.plan.camera))
        return TeeRecorder(RerunRecorder(f"{stem}.rrd"), film)


def _real_run_episode() -> RunEpisode:
    from mpgrasp.episode import run_episode

    return run_episode


def play_all(
    plan: Plan,
    sink: Callable[[Line], None],
    *,
    workers: int = 1,
    player: Player | None = None,
    run_episode: RunEpisode | None = None,
) -> None:
    """Play all episodes of a plan and hand their lines to `sink`, in the plan's order.

    On KeyboardInterrupt every finished episode has been handed over before it is raised again.

    Args:
        plan: what to run.
        sink: is called with one line after the other, and is never interrupted.
        workers: number of processes; 1 plays in this one.
        player: serves `workers=1` where the caller has made one already.
        run_episode: stands in for `mpgrasp.episode.run_episode`.

    Raises:
        ConfigError: fewer than one worker.
        EpisodeError: an episode or a worker broke off. The lines before it have been handed over.
    """
    if workers < 1:
        raise ConfigError("workers out of range", got=workers, allowed="1 or more")
    if workers > 1:
        _play_in_processes(plan, sink, workers, run_episode)
        return
    player = player or Player(plan, run_episode)
    for task in plan.tasks():
        line = player.play(task)
        with _interrupts_wait():
            sink(line)


def _play_in_processes(
    plan: Plan, sink: Callable[[Line], None], workers: int, run_episode: RunEpisode | None
) -> None:
    tasks = plan.tasks()
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        min(workers, len(tasks)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(plan, run_episode),
    )
    waiting: deque[Future[Line]] = deque()

    def hand_over_oldest() -> None:
        line = waiting[0].result()
        with _interrupts_wait():
            waiting.popleft()
            sink(line)

    try:
        for task in tasks:
            # one episode a worker in hand and one in reserve: little to throw away on Ctrl-C
            if len(waiting) >= 2 * workers:
                hand_over_oldest()
            waiting.append(pool.submit(_play_in_worker, task))
        while waiting:
            hand_over_oldest()
    except KeyboardInterrupt:
        for future in waiting:  # some may be finished behind one that is not
            if future.done() and not future.cancelled() and future.exception() is None:
                sink(future.result())
        raise
    except BrokenProcessPool as error:
        raise EpisodeError(
            "a worker process died", allowed="enough memory for every worker, or fewer --workers"
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Ctrl-C inside of the block takes effect after it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if arrived:
        raise KeyboardInterrupt


_player: Player | None = None
"""The worker process's own."""


def _start_worker(plan: Plan, run_episode: RunEpisode | None) -> None:
    global _player
    # Ctrl-C reaches the whole process group; the parent decides what becomes of its workers
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, daemon=True).start()
    _player = Player(plan, run_episode)


def _die_with_parent() -> None:
    """A killed parent cannot end its workers, and they would wait for work for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _play_in_worker(task: Task) -> Line:
    assert _player is not None
    return _player.play(task)
