"""Ends a run whose method fails alike among its first episodes: hours of error rows tell nothing new."""

from __future__ import annotations

import re
from collections import Counter, defaultdict

from mpgrasp.bench.playing.player import EpisodeError
from mpgrasp.bench.record import Cell, ErrorLine, Line

FIRST = 5
"""So many first episodes of a method are looked at: a wrong unit may pass unseen in one or two of them."""
ALIKE = 3
"""So many of them with the same error end the run."""

_NUMBER = re.compile(r"[-+]?\d[\d.,]*(?:e[-+]?\d+)?")


class Patience:
    """Looks at the lines of a run as they come, in whatever order."""

    def __init__(self) -> None:
        self._errors: dict[Cell, dict[int, str]] = defaultdict(dict)

    def see(self, line: Line) -> None:
        """Take note of a line.

        Raises:
            EpisodeError: it is the third of a cell's first five episodes with the same error.
        """
        if not isinstance(line, ErrorLine) or line.episode >= FIRST:
            return
        cell = self._errors[line.task.cell]
        cell[line.episode] = line.error.removeprefix(str(line.task)).strip()
        kinds = Counter(map(_kind, cell.values()))
        if kinds[_kind(cell[line.episode])] >= ALIKE:
            raise EpisodeError(
                f"{line.task.cell.method} fails alike in {ALIKE} of its first {FIRST} episodes of "
                f"{line.suite}, so the run ends here and its finished episodes are kept: {cell[line.episode]}"
            )


def _kind(error: str) -> str:
    """Return an error without its numbers, which differ from episode to episode."""
    return _NUMBER.sub("#", error)
