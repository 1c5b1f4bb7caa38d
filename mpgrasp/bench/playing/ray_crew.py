"""Actors of Ray that play tasks, on this machine or on a cluster: `--engine ray`.

Each actor holds a player with detectors and controllers of its own, and is given one episode at a time. One
that dies, with its node or alone, costs the episode that it had in hand, which is played again elsewhere.
What is written beside the lines (recordings, traces) goes to the run's folder, which nodes must share.
"""

from __future__ import annotations

import importlib
import os
import re
import socket
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import EpisodeError, Games, Player
from mpgrasp.bench.playing.round import Round
from mpgrasp.bench.playing.workers import FAILED_STARTS, time_limit
from mpgrasp.bench.record import Line, Task
from mpgrasp.exceptions import ConfigError, MpgraspError
from mpgrasp.extras import check_installed

PASSED_ON = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_CORETYPE", "MUJOCO_GL")
"""Environment variables that decide results, as they are here."""
ANSWER_LIMIT = 10.0
"""Time in which somebody must answer at a cluster's address [s]."""
_HOST_AND_PORT = re.compile(r"(ray://)?(?P<host>[^/\s]+):(?P<port>\d+)")
_CLUSTER = "the address of a cluster that runs, HOST:PORT, ray://HOST:PORT or auto"
_LOOK = 1.0  # seconds between two looks at the clock


class RayCrew:
    """Plays tasks in actors of Ray; implements `crew.Crew`.

    Args:
        plan: what is played.
        size: number of actors, each with a core.
        run_episode: plays one episode.
        address: of a cluster that runs, such as auto or ray://head:10001; None starts Ray on this machine.
        hang_after: wall-clock time that an episode may take before its actor is killed [s]; None for that of
            its trial.
        attempts: times an episode is tried before it becomes an error row.

    Raises:
        ConfigError: there is no cluster at the address.
    """

    def __init__(
        self,
        plan: Plan,
        size: int,
        run_episode: Games,
        *,
        address: str | None,
        hang_after: float | None,
        attempts: int,
    ) -> None:
        self._ray = _connected(address, size)
        self._plan, self._size, self._hang_after, self._attempts = plan, size, hang_after, attempts
        self._make = self._ray.remote(num_cpus=1, max_restarts=0)(_Host).remote
        self._shared = self._ray.put(plan), self._ray.put(run_episode)  # sent to each node once
        self._hosts: list[Any] = []
        self._idle: list[Any] = []  # those that wait for a task
        self._answers: dict[Any, tuple[Any, Task | None, float]] = {}  # by reference: host, task, deadline
        self._failed_starts = 0
        self.losses = 0

    def play(self, tasks: Iterable[Task], sink: Callable[[Line], None], note: Callable[[str], None]) -> None:
        todo = Round(self._plan, tasks, attempts=self._attempts, sink=sink, note=note)
        while todo.has(1) or self._at_work():
            while self._idle and (task := todo.next()) is not None:
                self._give(self._idle.pop(), task)
            while len(self._hosts) < self._size and todo.has(len(self._hosts) - self._at_work() + 1):
                self._add_host()
            for host, task, (kind, content) in self._next_answers():
                if kind == "refused":
                    raise content
                if kind == "dead":
                    self._dismiss(host)
                    if task is None:
                        self._count_failed_start(content)
                    else:
                        todo.lost(task, f"{task} {content}", "no traceback: its actor was gone\n")
                    continue
                self._idle.append(host)
                if kind == "ready":
                    self._failed_starts = 0
                elif task is not None:
                    self.losses += todo.hear(task, kind, content)

    def close(self) -> None:
        for host in list(self._hosts):
            self._dismiss(host)
        self._ray.shutdown()

    def _at_work(self) -> int:
        """Number of hosts that play; those that start do not."""
        return sum(task is not None for _, task, _ in self._answers.values())

    def _add_host(self) -> None:
        host = self._make(*self._shared)
        self._hosts.append(host)
        # a cluster may first have to start a machine for it, so that nobody knows how long that takes
        self._answers[host.ready.remote()] = host, None, float("inf")

    def _give(self, host: Any, task: Task) -> None:
        deadline = time.monotonic() + time_limit(self._plan, task, self._hang_after)
        self._answers[host.play.remote(task)] = host, task, deadline

    def _next_answers(self) -> list[tuple[Any, Task | None, tuple[str, Any]]]:
        """Host, task and answer of those that have something to say or have had their time."""
        if not self._answers:
            return []
        there, _ = self._ray.wait(list(self._answers), num_returns=1, timeout=_LOOK)
        found = []
        for reference in there:
            host, task, _ = self._answers.pop(reference)
            try:
                answer = self._ray.get(reference)
            except self._ray.exceptions.RayError as error:
                answer = "dead", f"crashed: its actor is gone ({_words(error)})"
            found.append((host, task, answer))
        late = [ref for ref, (_, _, deadline) in self._answers.items() if deadline <= time.monotonic()]
        for reference in late:
            host, task, _ = self._answers.pop(reference)
            assert task is not None
            limit = time_limit(self._plan, task, self._hang_after)
            found.append((host, task, ("dead", f"hung: no answer within {limit:g} s")))
        return found

    def _dismiss(self, host: Any) -> None:
        self._hosts.remove(host)  # it is not idle, or nothing of it would have been heard
        with suppress(self._ray.exceptions.RayError, ValueError):
            self._ray.kill(host)

    def _count_failed_start(self, what: str) -> None:
        self._failed_starts += 1
        if self._failed_starts >= FAILED_STARTS:
            raise EpisodeError(
                f"actors die while they start: the last one {what}",
                allowed="mpgrasp and the plug-ins on every node, and enough memory for every actor",
            )


def check(address: str | None) -> None:
    """Make sure that Ray is installed, and that somebody answers at the address.

    Raises:
        ConfigError: it is not, or nobody does.
    """
    check_installed("ray", "--engine ray")
    where = _HOST_AND_PORT.fullmatch(address or "")
    if where is None:  # a Ray of its own, or a name such as auto, which Ray looks up at once
        return
    try:  # Ray itself would go on trying for a quarter of an hour
        socket.create_connection((where["host"], int(where["port"])), timeout=ANSWER_LIMIT).close()
    except (OSError, OverflowError) as error:
        raise ConfigError(f"no Ray there ({error})", got=address, allowed=_CLUSTER) from error


def _connected(address: str | None, size: int) -> Any:
    """The module ray, connected to a cluster, or to a Ray of its own with so many cores."""
    ray = importlib.import_module("ray")
    variables = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    where: dict[str, Any] = {"address": address}
    if address is None:  # on a cluster, cores and modules are its own business
        where = {"num_cpus": size, "include_dashboard": False}
        variables["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # or it warns of a change to come
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        ray.init(**where, log_to_driver=False, logging_level="error", runtime_env={"env_vars": variables})
    except (ConnectionError, ValueError, RuntimeError, TimeoutError) as error:
        raise ConfigError(f"no Ray there ({_words(error)})", got=address, allowed=_CLUSTER) from error
    return ray


def _words(error: BaseException) -> str:
    """The last line of what Ray says, which is the cause where there is one."""
    return next(reversed(str(error).strip().splitlines()), type(error).__name__).strip()


class _Host:
    """The actor."""

    def __init__(self, plan: Plan, run_episode: Games) -> None:
        self._plan, self._run_episode = plan, run_episode
        self._player: Player | None = None

    def ready(self) -> tuple[str, Any]:
        """(ready, None), or (refused, error) where a detector or controller cannot be had."""
        try:
            self._player = Player(self._plan, self._run_episode)
        except MpgraspError as error:
            return "refused", error
        return "ready", None

    def play(self, task: Task) -> tuple[str, Any]:
        """(line, (Line, lost)) or (broke, (what, trace, certain))."""
        assert self._player is not None
        try:
            line = self._player.play(task)
            return "line", (line, self._player.lost)
        except EpisodeError as error:
            broke = str(error), traceback.format_exc(), error.certain
            # an error may leave a detector behind in a state that the next episode must not see
            self._player = Player(self._plan, self._run_episode)
            return "broke", broke
