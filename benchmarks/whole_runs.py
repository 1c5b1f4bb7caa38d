"""Runs of the benchmark in processes of their own, and whether two of them have the same results."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from refusals import BENCH, Ended, run

from mpgrasp.bench.results.reader import read_lines
from mpgrasp.exceptions import OutputError

PLAY_LIMIT = 600.0
"""Wall-clock time after which a run of the study counts as hung [s]."""


@dataclass(frozen=True, kw_only=True)
class Way:
    """One of two ways to play the same episodes."""

    options: tuple[str, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)


def results(folder: Path) -> list[str]:
    """Every line of a run without its timing, in the order of their names."""
    rows = [line.as_row() for line in read_lines(folder).lines]
    return sorted(json.dumps({**row, "timing": None}, sort_keys=True) for row in rows)


def different(one: Path, other: Path) -> str:
    """Return what differs in the results of two runs; "" if nothing does."""
    a, b = results(one), results(other)
    if a != b:
        return f"{len(set(a) - set(b))} of {len(a)} lines differ"
    return ""


def fault_at_end(ended: Ended, codes: Sequence[int] = (0,)) -> str:
    """Return what is wrong with the end of a command; "" if nothing is."""
    if ended.code is None:
        return f"still at work after {ended.seconds:.0f} s"
    if "Traceback (most recent call last)" in ended.out + ended.err:
        return "a traceback"
    if ended.code not in codes:
        return f"exit code {ended.code}: {ended.err.strip()[-200:]}"
    return ""


@dataclass(frozen=True)
class Bench:
    """A folder in which real runs are played; `cache` holds what networks were compiled to."""

    folder: Path
    cache: Path

    def play(self, words: Sequence[str], way: Way | None = None, limit: float = PLAY_LIMIT) -> Ended:
        """Play a command line of the benchmark to its end."""
        way = way or Way()
        return run(
            [*BENCH, *words, *way.options, "--quiet"],
            self.folder,
            {"MPGRASP_CACHE": str(self.cache), **way.environment},
            limit,
        )

    def play_whole(self, words: Sequence[str], out: Path) -> Path:
        """Play a run that nothing disturbs, and return its folder.

        Raises:
            OutputError: it does not come to its end: there is nothing to compare with.
        """
        if fault := fault_at_end(self.play(words)):
            raise OutputError(f"an undisturbed run breaks off: {fault}", got=str(out))
        return out


def row_of(kind: str, name: str, fault: str, seconds: float) -> dict[str, object]:
    """A row of the study."""
    return {"kind": kind, "name": name, "fault": fault, "seconds": round(seconds, 2)}
