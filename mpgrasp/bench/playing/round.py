"""Tasks of one round of play: which is next, and what becomes of one that was played or broke off."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Any

from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import error_line, loss_note
from mpgrasp.bench.record import Line, Task


class Round:
    """Tasks of which only the next ones are made, and the troubles of those that broke off.

    Args:
        plan: that they belong to.
        tasks: in the order in which they are begun.
        attempts: times an episode is tried before it becomes an error row.
        sink: takes the lines, error rows among them.
        note: is told in words of every episode that is tried again, and of recordings that are lost.
    """

    def __init__(
        self,
        plan: Plan,
        tasks: Iterable[Task],
        *,
        attempts: int,
        sink: Callable[[Line], None],
        note: Callable[[str], None],
    ) -> None:
        self._plan, self._attempts, self._sink, self._note = plan, attempts, sink, note
        self._later, self._first = iter(tasks), deque[Task]()
        self._troubles: dict[Task, list[tuple[str, str]]] = defaultdict(list)

    def next(self) -> Task | None:
        """Take the next task; None where there is none."""
        return self._first.popleft() if self._first else next(self._later, None)

    def put_back(self, task: Task) -> None:
        """Let a task be the next one."""
        self._first.appendleft(task)

    def has(self, n: int) -> bool:
        """True if there are n tasks or more."""
        self._first.extend(islice(self._later, max(n - len(self._first), 0)))
        return len(self._first) >= n

    def hear(self, task: Task, kind: str, content: Any) -> bool:
        """Take what came of a task.

        Args:
            task: the episode.
            kind: "line" or "broke".
            content: (Line, recordings that are lost), or the arguments of `lost`.

        Returns:
            True if something of its recordings is lost.
        """
        if kind == "broke":
            self.lost(task, *content)
            return False
        line, lost_recordings = content
        self._sink(line)
        if lost_recordings:
            self._note(loss_note(task, lost_recordings))
        return bool(lost_recordings)

    def lost(self, task: Task, what: str, trace: str, certain: bool = False) -> None:
        """Have an episode that broke off played again, or else told by an error row.

        Args:
            task: the episode.
            what: went wrong.
            trace: where.
            certain: True if another attempt would end in the same way.
        """
        troubles = self._troubles[task]
        troubles.append((what, trace))
        if len(troubles) < self._attempts and not certain:
            self._note(f"{what}; it is played again")
            self.put_back(task)
        else:
            self._sink(error_line(self._plan, task, troubles))
            del self._troubles[task]
