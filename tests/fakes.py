"""Stand-ins that let the benchmark's bookkeeping be tested in milliseconds."""

from __future__ import annotations

import ctypes
import gc
import os
import signal
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from mpgrasp.bench.results.run_card import WorldCard


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


class OtherDetector(FakeDetector):
    pass


class TunableDetector(FakeDetector):
    def __init__(self, threshold: float = 0.5) -> None:
        super().__init__()
        self.threshold = threshold


class NotADetector:
    pass


class FailsToStart:
    def __init__(self) -> None:
        raise RuntimeError("no licence")


WORLD = WorldCard(physics={}, camera={}, motion={}, ik={}, reflex={})
"""World card of episodes that are not played."""


@dataclass
class FakeResult:
    seed: int
    scene: Any

    def as_record(self) -> dict[str, Any]:
        success, item = self.seed % 3 != 0, self.scene.objects[0]
        return {
            "object": getattr(item, "name", item),
            "outcome": "success" if success else "missed",
            "success": success,
            "sim_time_s": round(5.0 + self.seed % 1000 / 700, 6),
            "ticks": 50,
            "reflex": None,
            "min_singular_value": 0.1,
            "near_singularity_s": 0.0,
            "path_length_m": 0.333333333,
            "jerk_rms": 2.0,
            "spectral_arc_length": -1.5,
            "first_detection_s": None,
            "blind_drift_m": 0.01,
            "grasp": None,
            "timing": {"detect": time.perf_counter()},
            "state_hash": f"{self.seed:08x}",
        }


def _seed(episode: int) -> int:
    from mpgrasp.suite import episode_seed

    return episode_seed("thin", 0, episode)


def run_episode(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    return FakeResult(seed, scene_config)


def slow_first_episode(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Later episodes are ready before the first one."""
    time.sleep(0.5 if seed == _seed(0) else 0.0)
    return FakeResult(seed, scene_config)


def breaks_off(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Every episode but the first finds a bug."""
    if seed != _seed(0):
        raise ZeroDivisionError("a bug in a detector")
    return FakeResult(seed, scene_config)


def crashes(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Ends its process in three ways: of its own accord, as one that runs out of memory, by a bad pointer."""
    if seed == _seed(1):
        os._exit(9)
    if seed == _seed(2):
        os.kill(os.getpid(), signal.SIGKILL)
    if seed == _seed(3):
        ctypes.string_at(0)
    return FakeResult(seed, scene_config)


def hangs(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Never comes back from episode 1."""
    if seed == _seed(1):
        time.sleep(3600)
    return FakeResult(seed, scene_config)


def lets_go(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Closes its end of the pipe in episode 1 and goes on, out of reach."""
    if seed == _seed(1):
        for connection in [item for item in gc.get_objects() if isinstance(item, Connection)]:
            connection.close()
        time.sleep(20)
    return FakeResult(seed, scene_config)


def dies_once(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Ends its process in episode 1 unless that has happened before."""
    if seed == _seed(1):
        try:
            Path(os.environ["MPGRASP_TEST_MARK"]).touch(exist_ok=False)
        except FileExistsError:
            return FakeResult(seed, scene_config)
        os._exit(9)
    return FakeResult(seed, scene_config)


def brisk(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Takes 2 ms."""
    time.sleep(0.002)
    return FakeResult(seed, scene_config)


def unhurried(scene_config: Any, seed: int, **_: Any) -> FakeResult:
    """Slow enough to be interrupted."""
    time.sleep(0.1)
    return FakeResult(seed, scene_config)


def ends_at_once(*_: Any) -> None:
    """A worker that does not get as far as its first episode."""
    os._exit(3)


def other_world(scene_config: Any, seed: int, **_: Any) -> Any:
    """As if the code had changed: one tick more."""

    class Longer(FakeResult):
        def as_record(self) -> dict[str, Any]:
            return {**super().as_record(), "ticks": 51}

    return Longer(seed, scene_config)
