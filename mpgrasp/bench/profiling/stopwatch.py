"""A stopwatch of CPU time with stages inside of stages: no second is counted twice."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple


class Entry(NamedTuple):
    """What time is counted to."""

    part: str
    """Part of an episode."""
    stage: str
    """What is done there."""


class Stopwatch:
    """CPU time of this process, of all of its threads, by part of an episode and by stage.

    Args:
        clock: that is read [s].
    """

    def __init__(self, clock: Callable[[], float] = time.process_time) -> None:
        self._clock = clock
        self._inner = [0.0]  # time of the stages within, for every stage that has begun
        self.part = ""
        """Part of an episode that lasts now."""
        self.seconds: dict[Entry, float] = defaultdict(float)
        """Time of each stage without the stages inside of it [s]."""
        self.calls: dict[Entry, int] = defaultdict(int)
        """Number of times that each stage began."""

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count the block to a stage of the part that lasts when it begins."""
        entry, start = Entry(self.part, name), self._clock()
        self._inner.append(0.0)
        try:
            yield
        finally:
            elapsed = self._clock() - start
            self.seconds[entry] += elapsed - self._inner.pop()
            self.calls[entry] += 1
            self._inner[-1] += elapsed

    @contextmanager
    def during(self, part: str) -> Iterator[None]:
        """Let a part of an episode last as long as the block."""
        before, self.part = self.part, part
        try:
            yield
        finally:
            self.part = before

    def total(self, part: str | None = None, stage: str | None = None) -> float:
        """Return the time of a part, of a stage, of a stage in a part, or of everything [s]."""
        return sum(
            seconds
            for entry, seconds in self.seconds.items()
            if part in (None, entry.part) and stage in (None, entry.stage)
        )
