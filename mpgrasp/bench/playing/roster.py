"""Order of a run's episodes: suite after suite, episode by episode, every method in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mpgrasp.bench.record import Method, Task


@dataclass(frozen=True, kw_only=True)
class Roster:
    """Episodes of a run, without a list of them."""

    suites: Mapping[str, int]
    """Number of episodes of each method in each suite, in order."""
    methods: Sequence[Method]
    """In the order of their turns."""

    def __len__(self) -> int:
        return sum(self.suites.values()) * len(self.methods)

    def __contains__(self, task: Task) -> bool:
        return task.cell.method in self.methods and 0 <= task.episode < self.suites.get(task.suite, 0)

    def place(self, task: Task) -> tuple[int, ...]:
        """Place of a task: of two tasks, the one with the lesser place is first.

        What is of another suite or method comes after everything else.
        """
        method = task.cell.method
        if task.suite not in self.suites or method not in self.methods:
            return (len(self.suites),)
        return list(self.suites).index(task.suite), task.episode, self.methods.index(method)
