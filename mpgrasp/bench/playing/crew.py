"""Plays tasks of a plan, in worker processes or in this one; what breaks is tried once more.

Lines are handed over as soon as they are there, in whatever order that is, and each says the same
whatever the number of workers: a line depends on its task alone.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Protocol

from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import EpisodeError, Games, Player, error_line, loss_note, real_games
from mpgrasp.bench.playing.workers import WorkerPool
from mpgrasp.bench.record import Line, Task
from mpgrasp.detectors.runtimes import SHARED
from mpgrasp.exceptions import ConfigError

ATTEMPTS = 2
"""Times an episode is tried before it becomes an error row."""

ENGINES = ("processes", "ray")
"""What plays: processes of this machine, or actors of Ray."""

Sink = Callable[[Line], None]
Note = Callable[[str], None]


class Crew(Protocol):
    """Plays tasks."""

    losses: int
    """Episodes so far of whose recordings something could not be written."""

    def play(self, tasks: Iterable[Task], sink: Sink, note: Note) -> None:
        """Play tasks.

        Args:
            tasks: in the order in which they are begun.
            sink: takes each line as soon as it is finished; an episode that could not be played in
                `ATTEMPTS` attempts, or at once where a plug-in returned what cannot be used, has a line
                too (`player.error_line`).
            note: is told in words of every episode that is tried again, and of recordings that are lost.

        Raises:
            MpgraspError: no worker can be started.
        """
        ...

    def close(self) -> None:
        """Let go of the worker processes, whatever they do."""
        ...


def check_engine(engine: str, workers: int, address: str | None) -> None:
    """Make sure that an engine can play here.

    Args:
        engine: one of `ENGINES`.
        workers: their number.
        address: of a cluster of Ray; None without one.

    Raises:
        ConfigError: an unknown engine, an address or a number of workers that does not go with it, or a Ray
            that is not there.
    """
    if engine not in ENGINES:
        raise ConfigError("unknown engine", got=engine, allowed=ENGINES)
    if engine == "ray":
        if not workers:
            raise ConfigError("--engine ray without workers", got=0, allowed="--workers 1 or more")
        from mpgrasp.bench.playing.ray_crew import check

        check(address)
    elif address is not None:
        raise ConfigError("--address without --engine ray", got=address, allowed="both or none")


@contextmanager
def shared_networks(runtime: str, engine: str) -> Iterator[None]:
    """Have an inference server as long as the block lasts, if that is the runtime.

    Raises:
        ConfigError: with actors of Ray, which may be on other machines; or it does not start.
    """
    if runtime != SHARED:
        yield
        return
    if engine == "ray":
        raise ConfigError("--runtime shared with --engine ray", got=engine, allowed="--engine processes")
    from mpgrasp.detectors.runtimes.server import inference_server

    with inference_server():
        yield


def make_crew(
    plan: Plan,
    workers: int,
    *,
    run_episode: Games | None = None,
    player: Player | None = None,
    hang_after: float | None = None,
    engine: str = "processes",
    address: str | None = None,
) -> Crew:
    """The crew that plays a plan.

    Args:
        plan: what is played.
        workers: number of processes; 0 plays in this process, for debuggers: what crashes or hangs
            there takes the run along.
        run_episode: plays one episode; `mpgrasp.episode.episode.run_episode` if not given. It reaches the
            workers by its import path.
        player: to use in this process, if there is one already.
        hang_after: wall-clock time that an episode may take before its worker is killed [s]; None for
            that of its trial (`workers.HANG_AFTER`).
        engine: one of `ENGINES`: processes of this machine, or actors of Ray.
        address: of a cluster of Ray; None starts one on this machine.

    Raises:
        ConfigError: numbers that cannot be used, or no cluster at the address.
    """
    if workers < 0:
        raise ConfigError("workers out of range", got=workers, allowed="0 or more")
    if hang_after is not None and not hang_after > 0:
        raise ConfigError("hang-after out of range", got=hang_after, allowed="more than 0 s")
    run_episode = run_episode or real_games()
    if engine == "ray":
        from mpgrasp.bench.playing.ray_crew import RayCrew

        return RayCrew(plan, workers, run_episode, address=address, hang_after=hang_after, attempts=ATTEMPTS)
    if workers:
        return WorkerPool(plan, workers, run_episode, hang_after=hang_after, attempts=ATTEMPTS)
    return _ThisProcess(plan, run_episode, player)


class _ThisProcess:
    def __init__(self, plan: Plan, run_episode: Games, player: Player | None) -> None:
        self._plan, self._run_episode = plan, run_episode
        self._player = player or Player(plan, run_episode)
        self.losses = 0

    def play(self, tasks: Iterable[Task], sink: Sink, note: Note) -> None:
        for task in tasks:
            sink(self._line(task, note))
            if self._player.lost:
                self.losses += 1
                note(loss_note(task, self._player.lost))

    def close(self) -> None:
        pass

    def _line(self, task: Task, note: Note) -> Line:
        troubles: list[tuple[str, str]] = []
        while len(troubles) < ATTEMPTS:
            try:
                return self._player.play(task)
            except EpisodeError as error:
                troubles.append((str(error), traceback.format_exc()))
                # an error may leave a detector behind in a state that the next episode must not see
                self._player = Player(self._plan, self._run_episode)
                if error.certain:
                    break
                if len(troubles) < ATTEMPTS:
                    note(f"{error}; it is played again")
        return error_line(self._plan, task, troubles)
