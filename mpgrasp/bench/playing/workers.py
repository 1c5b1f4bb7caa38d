"""Worker processes that may crash or hang without harm to the run: each episode is somebody's to lose.

Every worker has a pipe of its own, so that it is known which episode died with it, and a file into which
faulthandler writes the Python stack of a crash or a hang. A library pool says neither.
"""

from __future__ import annotations

import faulthandler
import math
import multiprocessing
import os
import signal
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import EpisodeError, Games, Player
from mpgrasp.bench.playing.round import Round
from mpgrasp.bench.record import Line, Task
from mpgrasp.exceptions import MpgraspError
from mpgrasp.foreign_code import load_limit
from mpgrasp.processes import born_deaf, die_with_parent, ignore_interrupts

HANG_AFTER: Mapping[str, float] = {"grasp": 600.0, "clear": 3600.0}
"""Wall-clock time that an episode may take unless told otherwise, by trial [s].

A usual grasp takes 5 to 10 s; a table may take 60 times as long to clear (`ClearingConfig.time_limit`).
"""
START_LIMIT = 300.0
"""Wall-clock time that a worker may take to import, load weights and compile networks [s]."""
GRACE = 1.0
"""Time between the dump of a hanging worker's stack and its end [s]."""
END_LIMIT = 10.0
"""Wall-clock time that a process may take to end once its pipe has ended [s]; usually next to none."""
FAILED_STARTS = 3
"""Workers in a row that may die while they start before the run gives up."""


def time_limit(plan: Plan, task: Task, hang_after: float | None) -> float:
    """Wall-clock time that an episode may take [s]: what the user says, or else what is usual."""
    return HANG_AFTER[plan.suite(task.suite).trial] if hang_after is None else hang_after


_context = multiprocessing.get_context("spawn")


class WorkerPool:
    """Plays tasks in processes; implements `crew.Crew`."""

    def __init__(
        self, plan: Plan, size: int, run_episode: Games, *, hang_after: float | None, attempts: int
    ) -> None:
        self._plan, self._size, self._run_episode = plan, size, run_episode
        self._hang_after, self._attempts = hang_after, attempts
        self._workers: list[_Worker] = []
        self._failed_starts = 0
        self.losses = 0

    def play(self, tasks: Iterable[Task], sink: Callable[[Line], None], note: Callable[[str], None]) -> None:
        todo = Round(self._plan, tasks, attempts=self._attempts, sink=sink, note=note)
        while todo.has(1) or self._busy():
            self._hand_out(todo)
            for worker in self._wait():
                task, (kind, content) = worker.task, worker.answer()
                worker.task = None
                if kind == "refused":
                    raise content
                if kind == "dead":
                    self._dismiss(worker)
                    if task is not None:
                        todo.lost(task, f"{task} {content}", worker.trace())
                    elif not worker.ready:
                        self._count_failed_start(content, worker.trace())
                elif kind == "ready":
                    worker.ready = True
                    self._failed_starts = 0
                elif task is not None:
                    self.losses += todo.hear(task, kind, content)

    def close(self) -> None:
        while self._workers:
            self._dismiss(self._workers[-1])

    def _busy(self) -> list[_Worker]:
        return [worker for worker in self._workers if worker.task is not None]

    def _hand_out(self, todo: Round) -> None:
        while len(self._workers) < self._size and todo.has(len(self._workers) - len(self._busy()) + 1):
            self._workers.append(_Worker(self._plan, self._run_episode))
        for worker in self._workers:
            # one that died idle refuses, and is found out by the next wait
            task = todo.next() if worker.ready and worker.task is None else None
            if task is not None and not worker.give(task, self._limit(task)):
                todo.put_back(task)

    def _limit(self, task: Task) -> float:
        return time_limit(self._plan, task, self._hang_after)

    def _wait(self) -> list[_Worker]:
        """Workers that have something to say or have had their time."""
        soonest = min(worker.deadline for worker in self._workers)
        left = None if soonest == math.inf else max(0.0, soonest - time.monotonic())
        ready = wait([worker.connection for worker in self._workers], left)
        now = time.monotonic()
        return [w for w in self._workers if w.connection in ready or w.deadline <= now]

    def _dismiss(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.end()

    def _count_failed_start(self, what: str, trace: str) -> None:
        self._failed_starts += 1
        if self._failed_starts >= FAILED_STARTS:
            raise EpisodeError(
                f"worker processes die while they start: the last one {what}",
                got=trace.strip() or None,
                allowed="enough memory for every worker, or fewer --workers",
            )


class _Worker:
    """The run's end of one worker process."""

    def __init__(self, plan: Plan, run_episode: Games) -> None:
        self.connection, theirs = _context.Pipe()
        self._log, name = tempfile.mkstemp(prefix="mpgrasp-worker-", suffix=".log")
        self._log_name = Path(name)
        self._process = _context.Process(target=_work, args=(theirs, plan, run_episode, name), daemon=True)
        with born_deaf():
            self._process.start()
        theirs.close()  # or the end of the worker would not be the end of the pipe
        self._limit = _start_limit()
        self._trace = ""
        self.ready = False
        self.task: Task | None = None
        self.deadline = time.monotonic() + self._limit + GRACE

    def give(self, task: Task, limit: float) -> bool:
        """Hand over a task that may take `limit` seconds; False where nobody is there to take it."""
        try:
            self.connection.send((task, limit))
        except OSError:
            return False
        self.task, self._limit, self.deadline = task, limit, time.monotonic() + limit + GRACE
        return True

    def answer(self) -> tuple[str, Any]:
        """(ready, None), (line, (Line, lost)), (broke, (what, trace, certain)), (refused, error).

        Or, of one that says nothing any more, (dead, what).
        """
        if self.connection.poll():
            self.deadline = math.inf
            try:
                answer: tuple[str, Any] = self.connection.recv()
            except (EOFError, OSError):
                self._process.join(END_LIMIT)  # it may go on without its pipe: whoever is told ends it
                return "dead", f"crashed: its process {_cause(self._process.exitcode)}"
            return answer
        return "dead", f"hung: no answer within {self._limit:g} s"

    def trace(self) -> str:
        """The Python stack of a crash or a hang, once the process has ended."""
        return self._trace or "no traceback: the process had no time to leave one\n"

    def end(self) -> None:
        """Kill the process, which has nothing to lose, and keep what it left to say."""
        self._process.kill()
        self._process.join()
        self.connection.close()
        self._log_name.unlink(missing_ok=True)
        self._trace = os.pread(self._log, 1 << 16, 0).decode(errors="replace")
        os.close(self._log)


def _start_limit() -> float:
    """Wall-clock time that a worker may take to start [s]; plug-ins may be given more."""
    return max(START_LIMIT, 2 * load_limit() + GRACE)


def _cause(exitcode: int | None) -> str:
    if exitcode is None:
        return "closed its pipe and went on"
    if exitcode >= 0:
        return f"ended with exit code {exitcode}"
    with suppress(ValueError):
        return f"was killed by {signal.Signals(-exitcode).name}"
    return f"was killed by signal {-exitcode}"


def _work(connection: Connection, plan: Plan, run_episode: Games, log_name: str) -> None:
    """Play what the pipe brings, in a worker process, until the pipe ends."""
    ignore_interrupts()
    threading.Thread(target=die_with_parent, daemon=True).start()
    with Path(log_name).open("w") as log:
        # open in both processes by now; unnamed, it cannot be left behind
        Path(log_name).unlink(missing_ok=True)
        faulthandler.enable(log)
        faulthandler.dump_traceback_later(_start_limit(), file=log)
        try:
            player = Player(plan, run_episode)
            connection.send(("ready", None))
            while True:
                faulthandler.cancel_dump_traceback_later()
                task, limit = connection.recv()
                faulthandler.dump_traceback_later(limit, file=log)
                try:
                    line = player.play(task)
                    connection.send(("line", (line, player.lost)))
                except EpisodeError as error:
                    connection.send(("broke", (str(error), traceback.format_exc(), error.certain)))
                    # an error may leave a detector behind in a state that the next episode must not see
                    player = Player(plan, run_episode)
        except MpgraspError as error:
            connection.send(("refused", error))
        except (EOFError, OSError):
            pass  # the run is over
        finally:
            faulthandler.cancel_dump_traceback_later()
