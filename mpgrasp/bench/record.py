"""The words that all of the benchmark shares: cell, task, line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

Line = dict[str, Any]
"""One line of episodes.jsonl."""


ERROR = "error"
"""`outcome` of an episode that could not be played: no failure of a grasp, and counted apart."""


class Cell(NamedTuple):
    """A detector and a controller that play together."""

    detector: str
    """Registry name or import path."""
    controller: str
    """Registry name or import path."""


class Task(NamedTuple):
    """One episode of one cell: what tells one line of a run from all others."""

    suite: str
    episode: int
    detector: str
    controller: str

    @classmethod
    def of(cls, line: Mapping[str, Any]) -> Task:
        """The task that a line of episodes.jsonl is about."""
        return cls(*(line[name] for name in cls._fields))

    @property
    def stem(self) -> str:
        """File name, without ending, of what is recorded of this episode."""
        name = f"{self.suite}-{self.detector}-{self.controller}-{self.episode:04d}"
        return re.sub(r"[^A-Za-z0-9._-]+", "-", name)

    def __str__(self) -> str:
        return f"episode {self.episode} of {self.suite} ({self.detector}, {self.controller})"


Cells = dict[tuple[str, str, str], list[Mapping[str, Any]]]


def by_cell(episodes: Iterable[Mapping[str, Any]]) -> Cells:
    """Lines by (suite, detector, controller), in order of first appearance."""
    cells: Cells = {}
    for line in episodes:
        cells.setdefault((line["suite"], line["detector"], line["controller"]), []).append(line)
    return cells
