"""Latency of the loop: what is seen acts a while later, and until then what was decided before goes on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

from mpgrasp.controllers.controller import Command


class Span(NamedTuple):
    """A time over which one command acts."""

    command: Command | None
    """None before the first one has arrived."""
    ticks: int
    """Length in ticks of the velocity loop."""


class CommandQueue:
    """Commands on their way: each acts from when it is due, in the order in which they were given."""

    def __init__(self) -> None:
        self._coming: deque[tuple[int, Command]] = deque()
        self._acting: Command | None = None
        self._now = self._last_due = 0

    def spans(self, command: Command, delay: int, ticks: int) -> Iterator[Span]:
        """Take a command, and return what acts until the next one is given.

        Args:
            command: what was decided on what is seen now.
            delay: time until it acts [ticks of the velocity loop].
            ticks: time until the next command. The one that is done is the last: what was given before it
                goes on until it is due.
        """
        self._last_due = max(self._now + delay, self._last_due)
        self._coming.append((self._last_due, command))
        end = self._last_due if command.done else self._now + ticks
        while self._now < end:
            while self._coming and self._coming[0][0] <= self._now:
                self._acting = self._coming.popleft()[1]
            until = min(end, self._coming[0][0]) if self._coming else end
            yield Span(self._acting, until - self._now)
            self._now = until
