"""Ends a run whose method fails alike from its first episode on: hours of error rows tell nothing new."""

from __future__ import annotations

import re
from collections import defaultdict

from mpgrasp.bench.playing.player import EpisodeError
from mpgrasp.bench.record import Cell, ErrorLine, Line

EPISODES = 3
"""So many first episodes with the same error end the run."""

_NUMBER = re.compile(r"[-+]?\d[\d.,]*(?:e[-+]?\d+)?")


class Patience:
    """Looks at the lines of a run as they come, in whatever order."""

    def __init__(self) -> None:
        self._errors: dict[Cell, dict[int, str]] = defaultdict(dict)

    def see(self, line: Line) -> None:
        """Take note of a line.

        Raises:
            EpisodeError: it is the last of a cell's first `EPISODES` episodes, all with the same error.
        """
        if not isinstance(line, ErrorLine) or line.episode >= EPISODES:
            return
        cell = self._errors[line.task.cell]
        cell[line.episode] = line.error.removeprefix(str(line.task)).strip()
        if len(cell) == EPISODES and len(set(map(_kind, cell.values()))) == 1:
            raise EpisodeError(
                f"{line.task.cell.method} fails alike in its first {EPISODES} episodes of {line.suite}, "
                f"so the run ends here and its finished episodes are kept: {cell[0]}"
            )


def _kind(error: str) -> str:
    """Return an error without its numbers, which differ from episode to episode."""
    return _NUMBER.sub("#", error)
