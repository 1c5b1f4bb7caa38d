"""A progress bar on a terminal, a line every half minute in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from types import TracebackType

from mpgrasp.training.tracking import Tracker

LINE_EVERY = 30.0
"""Time between lines of a log [s]."""
FORGET = 0.95
"""Smoothing of the losses shown, per step."""


class ProgressLog:
    """Shows how far a training is. Use it as a context manager.

    Args:
        quiet: show nothing.
        tracker: takes losses and results of validations too.
    """

    def __init__(self, *, quiet: bool = False, tracker: Tracker | None = None) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self._quiet, self._tracker = quiet, tracker
        self._terminal = sys.stderr.isatty() and not quiet
        self._bar = Progress(
            TextColumn("train"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.description}"),
            disable=not self._terminal,
        )
        self._task = self._bar.add_task("", total=1.0)
        self._shown = 0.0
        self._last = (time.monotonic(), 0)
        self._losses: dict[str, float] = {}

    def __enter__(self) -> ProgressLog:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        if self._tracker is not None:
            self._tracker.close()

    def update(self, progress: float, step: int, images: int, losses: Mapping[str, float]) -> None:
        """Show a step: share of the budget, steps and images so far, and the step's losses."""
        if self._tracker is not None:
            self._tracker.log(step, {f"loss/{name}": value for name, value in losses.items()})
        for key, value in losses.items():
            self._losses[key] = FORGET * self._losses.get(key, value) + (1 - FORGET) * value
        now = time.monotonic()
        if self._quiet or now - self._shown < (1.0 if self._terminal else LINE_EVERY):
            return
        before, images_before = self._last
        rate = (images - images_before) / max(now - before, 1e-9) if images_before else 0.0
        self._shown, self._last = now, (now, images)
        values = "  ".join(f"{k} {v:.4f}" for k, v in self._losses.items())
        text = f"step {step}  {rate:.0f} images/s  {values}"
        self._bar.update(self._task, completed=progress, description=text)
        if not self._terminal:
            print(f"{100 * progress:5.1f} %  {text}", file=sys.stderr, flush=True)

    def validated(self, step: int, summary: Mapping[str, float], progress: str, text: str) -> None:
        """Show what a validation has found, and when."""
        self.note(f"{progress} validation  {text}")
        if self._tracker is not None:
            self._tracker.log(step, {f"validation/{name}": value for name, value in summary.items()})

    def note(self, text: str) -> None:
        """Show one line that stays."""
        if self._terminal:
            self._bar.console.print(text, markup=False, highlight=False)
        elif not self._quiet:
            print(text, file=sys.stderr, flush=True)
