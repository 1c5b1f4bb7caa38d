"""Stand-ins that let the benchmark's bookkeeping be tested in milliseconds."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class FakeDetector:
    name = "fake"

    def __init__(self, weights: Path | None = None) -> None:
        self.weights = weights

    def reset(self, truth: Any) -> None: ...

    def predict(self, frame: Any) -> Any: ...


class FakeController:
    name = "fake"

    def reset(self, seed: int) -> None: ...

    def update(self, observation: Any) -> Any: ...

    def final_grasp(self) -> None: ...

    def diagnostics(self) -> dict[str, Any]:
        return {}


class OtherController(FakeController):
    pass


class NotADetector:
    pass


class FailsToStart:
    def __init__(self) -> None:
        raise RuntimeError("no licence")


@dataclass
class FakeResult:
    seed: int
    scene: Any

    def as_record(self) -> dict[str, Any]:
        success = self.seed % 3 != 0
        return {
            "object": self.scene.objects[0],
            "outcome": "success" if success else "missed",
            "success": success,
            "sim_time_s": 5.0 + self.seed % 1000 / 700,
            "ticks": 50,
            "reflex": None,
            "min_singular_value": 0.1,
            "path_length_m": 1 / 3,
            "jerk_rms": 2.0,
            "grasp": None,
            "timing": {"detect": time.perf_counter()},
            "state_hash": f"{self.seed:08x}",
        }


def run_episode(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    return FakeResult(seed, scene_config)


def slow_first_episode(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Later episodes are ready before the first one."""
    from mpgrasp.bench.suite import episode_seed

    time.sleep(0.5 if seed == episode_seed("thin", 0, 0) else 0.0)
    return FakeResult(seed, scene_config)


def breaks_off(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Every episode but the first finds a bug."""
    from mpgrasp.bench.suite import episode_seed

    if seed != episode_seed("thin", 0, 0):
        raise ZeroDivisionError("a bug in a detector")
    return FakeResult(seed, scene_config)


def dies(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """As a process does that runs out of memory."""
    import os

    os._exit(9)


def unhurried(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Slow enough to be interrupted."""
    time.sleep(0.1)
    return FakeResult(seed, scene_config)
