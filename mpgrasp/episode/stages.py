"""Wall time of the stages of a control tick."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

STAGES = ("render", "detect", "control", "ik", "physics")
"""Stages of a control tick of the reach, in their order."""


class StageClock:
    """Collects how long each stage took, tick by tick."""

    def __init__(self) -> None:
        self._seconds: dict[str, list[float]] = defaultdict(list)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Count the wall time of the block to one of `STAGES`."""
        clock = time.perf_counter()
        yield
        self.add(stage, time.perf_counter() - clock)

    def add(self, stage: str, seconds: float) -> None:
        """Count a wall time [s] that was measured elsewhere to one of `STAGES`."""
        self._seconds[stage].append(seconds)

    def medians(self) -> dict[str, float]:
        """Return the median wall time of each stage so far [ms]; 0 for one that was never run."""
        return {stage: 1e3 * float(np.median(self._seconds[stage] or [0.0])) for stage in STAGES}
