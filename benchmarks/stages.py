"""Time that the parts of a 10 Hz control tick take, and the memory of a run.

    python benchmarks/stages.py --ticks 100

Plays reaches of the thin suite with the oracle and MP-PC, and times each stage of the real loop. The
oracle reads the true scene, so its own time says nothing and is left out; the networks are timed on the
same images.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from mpgrasp.command_line import COUNT, SEED, Parser, run_command

BUDGET_MS = 25.0
"""For a whole tick without the detector, on 2 cores [ms]."""
BUDGET_MB = 2000.0
"""For the whole process, networks included [MB]."""
PARTS = ("render", "noise", "grid map", "utility", "ik", "physics", "reflex")
"""The last one is all else that the velocity loop does: ramps, protective stops, statistics."""
NETWORK_IMAGES = 30
"""Images that each network is timed on, after a few to warm up."""


class Stopwatch:
    """Wall time per stage; a stage that runs inside of another one is taken out of that."""

    def __init__(self) -> None:
        self.ticks: dict[str, list[float]] = defaultdict(list)
        self._tick: dict[str, float] = defaultdict(float)
        self._inner = [0.0]

    @contextmanager
    def stage(self, name: str) -> Any:
        """Time the block as part of this tick."""
        self._inner.append(0.0)
        start = time.perf_counter()
        try:
            yield
        finally:
            elapsed = time.perf_counter() - start
            self.add(name, elapsed - self._inner.pop())
            self._inner[-1] += elapsed

    def add(self, name: str, seconds: float) -> None:
        """Add to a stage of this tick."""
        self._tick[name] += seconds

    def next_tick(self) -> None:
        """Close this tick."""
        for name in PARTS:
            self.ticks[name].append(self._tick.pop(name, 0.0))
        self._tick.clear()

    def wrap(self, owner: Any, attribute: str, name: str) -> None:
        """From now on, count the calls of a function as a stage."""
        function: Callable[..., Any] = getattr(owner, attribute)

        def timed(*args: Any, **kwargs: Any) -> Any:
            with self.stage(name):
                return function(*args, **kwargs)

        setattr(owner, attribute, timed)


def play(ticks: int, camera_backend: str, seed: int) -> tuple[Stopwatch, list[Any], str]:
    """Time reaches until there are enough ticks; returns the times, some images and the camera's backend."""
    from mpgrasp.camera import noise as sensor_noise
    from mpgrasp.camera.wrist_camera import WristCamera
    from mpgrasp.controllers import make_controller
    from mpgrasp.controllers.controller import Observation
    from mpgrasp.controllers.grid_map import GridMap
    from mpgrasp.detectors import make_detector
    from mpgrasp.motion.arm_driver import ArmDriver
    from mpgrasp.scene.scene import build_scene
    from mpgrasp.scene.simulation import Simulation
    from mpgrasp.suite import episode_seed, load_suite

    watch = Stopwatch()
    frames: list[Any] = []
    watch.wrap(sensor_noise, "apply", "noise")
    watch.wrap(GridMap, "update", "grid map")
    suite = load_suite("thin")
    config = suite.episode_config(camera=camera_backend)
    detector, controller = make_detector("oracle"), make_controller("mppc")
    episode = 0
    while len(watch.ticks["render"]) < ticks:
        scene = build_scene(suite.scene_config(episode), episode_seed(suite.name, seed, episode))
        simulation = Simulation(scene)
        camera = WristCamera(scene.model, camera_backend, crop=config.camera.crop)
        driver = ArmDriver(simulation)
        detector.reset(scene.height_map())
        controller.reset(episode)
        rng = np.random.default_rng([seed, episode])
        camera.capture(simulation.data, rng)  # the first image sets OpenGL up
        watch._tick.clear()
        done = False
        while not done and len(watch.ticks["render"]) < ticks:
            with watch.stage("render"):
                frame = camera.capture(simulation.data, rng)
            grasp_map = detector.predict(frame)
            observation = Observation(
                time=simulation.time, T_world_tcp=simulation.T_world_tcp, grasp_map=grasp_map
            )
            with watch.stage("utility"):
                command = controller.update(observation)
            before, start = driver.statistics(), time.perf_counter()
            done = command.done or driver.drive(command.twist, config.control_dt) is not None
            whole, after = time.perf_counter() - start, driver.statistics()
            ik, physics = after.ik_seconds - before.ik_seconds, after.physics_seconds - before.physics_seconds
            for name, seconds in (("ik", ik), ("physics", physics), ("reflex", whole - ik - physics)):
                watch.add(name, seconds)
            if not command.done:
                watch.next_tick()
            if len(frames) < NETWORK_IMAGES:
                frames.append(replace(frame, depth=frame.depth.copy()))
        backend = camera.backend
        camera.close()
        episode += 1
    return watch, frames, backend


def time_network(name: str, frames: list[Any]) -> float | None:
    """Median time of a detector on the images [ms]; None where it has no weights."""
    from mpgrasp.detectors import make_detector
    from mpgrasp.exceptions import WeightsError

    try:
        detector = make_detector(name)
    except WeightsError:
        return None
    times = []
    for frame in [*frames[:3], *frames]:
        start = time.perf_counter()
        detector.predict(frame)
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times[3:]))


def main(command: Sequence[str] | None = None) -> int:
    """Print the table; exit code 1 where a tick without detector, or memory, is over budget."""
    return run_command(lambda: _measure(command))


def _measure(command: Sequence[str] | None) -> int:
    from mpgrasp.camera.backends import BACKENDS
    from mpgrasp.detectors import DETECTORS

    parser = Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=COUNT, default=100, help="ticks to time (default: 100)")
    parser.add_argument("--camera", choices=BACKENDS, default="auto")
    parser.add_argument("--seed", type=SEED, default=0)
    arguments = parser.parse_args(command)

    watch, frames, backend = play(arguments.ticks, arguments.camera, arguments.seed)
    memory_without_networks = _peak_memory()
    median = {name: 1e3 * float(np.median(watch.ticks[name])) for name in PARTS}
    totals = 1e3 * np.sum([watch.ticks[name] for name in PARTS], axis=0)
    whole = float(np.median(totals))

    table = Table(title=f"One control tick, camera: {backend}, {os.cpu_count()} cores, {len(totals)} ticks")
    table.add_column("stage")
    for heading in ("median ms", "share"):
        table.add_column(heading, justify="right")
    for name in PARTS:
        table.add_row(name, f"{median[name]:.2f}", f"{100 * median[name] / sum(median.values()):.0f} %")
    table.add_section()
    late = float(np.percentile(totals, 95))
    table.add_row("tick without detector", f"{whole:.2f}", f"95 % under {late:.1f} ms")
    table.add_section()
    for name in DETECTORS:
        if name != "oracle":
            result = time_network(name, frames)
            table.add_row(f"detector {name}", "no weights" if result is None else f"{result:.1f}", "extra")
    console = Console()
    console.print(table)
    console.print(f"Budget of a tick without detector: {BUDGET_MS:.0f} ms.", highlight=False)
    memory = _peak_memory()
    console.print(
        f"Peak memory: {memory_without_networks:.0f} MB without networks, {memory:.0f} MB with all; "
        f"budget: {BUDGET_MB:.0f} MB.",
        highlight=False,
    )
    return int(whole > BUDGET_MS or memory > BUDGET_MB)


def _peak_memory() -> float:
    """Largest resident size of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    sys.exit(main())
