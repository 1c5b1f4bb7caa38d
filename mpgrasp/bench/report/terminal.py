"""Progress of a run on the terminal."""

from __future__ import annotations

import time
from collections.abc import Iterable
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from mpgrasp.bench.record import ErrorLine, Line, played
from mpgrasp.names import printable


class RunProgress:
    """A progress bar on a terminal, one line per episode elsewhere, nothing if quiet.

    Args:
        quiet: show nothing but notes.
        console: where to; standard error if not given.
    """

    def __init__(self, *, quiet: bool = False, console: Console | None = None) -> None:
        self._quiet = quiet
        self._console = console or Console(stderr=True)
        self._total = self._before = self._done = self._successes = 0
        self._start = time.monotonic()
        self._bar: Progress | None = None
        if self._console.is_terminal and not quiet:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[successes]} successes"),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                console=self._console,
            )
            self._task = self._bar.add_task("grasping", total=None, successes=0)

    def __enter__(self) -> RunProgress:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._bar:
            self._bar.stop()

    def start(self, finished: Iterable[Line]) -> None:
        """These episodes were finished in an earlier part of the run; the clock starts now."""
        before = self._successes = 0
        for line in played(finished):
            before, self._successes = before + 1, self._successes + line.success
        self._before = self._done = before
        self._start = time.monotonic()
        if self._bar:
            self._bar.reset(self._task, completed=self._done, successes=self._successes)
        elif before and not self._quiet:
            self.note(f"{before} episodes are there already")

    def expect(self, total: int) -> None:
        """There will be so many episodes in all."""
        self._total = total
        if self._bar:
            self._bar.update(self._task, total=total)

    def note(self, text: str) -> None:
        """Say something out of the ordinary, even if quiet."""
        self._console.out(f"mpgrasp: {printable(' '.join(text.split()))}", highlight=False)

    def add(self, line: Line) -> None:
        """One more episode is finished."""
        self._done += 1
        self._successes += bool(line.success)
        if self._bar:
            cell = escape(f"{line.suite} {line.detector} {line.controller}")
            self._bar.update(self._task, description=cell, completed=self._done, successes=self._successes)
        if isinstance(line, ErrorLine):
            self.note(f"error: {line.error}")
        elif not self._bar and not self._quiet:
            text = (
                f"[{self._done}/{self._total}, {self._time_left()}] {line.suite} "
                f"episode {line.episode}, {line.detector}, {line.controller}, {line.object}: "
                f"{line.outcome} in {line.sim_time_s:.1f} s"
            )
            self._console.out(printable(text), highlight=False)

    def _time_left(self) -> str:
        pace = (time.monotonic() - self._start) / (self._done - self._before)
        left = round(pace * (self._total - self._done))
        return f"{left // 60}:{left % 60:02d} left"
