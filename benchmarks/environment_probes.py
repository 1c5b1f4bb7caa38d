"""One environment's steps, timed: run by `environments.py` in the interpreter in which it is installed.

    python benchmarks/environment_probes.py robosuite --steps 50

Prints a line of JSON. Needs nothing but the environment itself, numpy and the standard library.
"""

from __future__ import annotations

import argparse
import importlib
import json
import statistics
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

Step = Callable[[], bool]
"""Takes a random action and looks; True if the episode is over."""

SIZE = 224
"""Side of robosuite's image [px]: as in its own examples of visual policies."""
WARM_UP = 5
"""Steps that are not counted."""


def mpgrasp(detector: str) -> tuple[Step, Callable[[], Any], str]:
    """A control tick of the suite `thin`: depth image, noise, detector, 10 ticks of IK, 50 of physics."""
    from mpgrasp.env import GraspEnv

    env = GraspEnv("thin", detector=detector)
    env.action_space.seed(0)

    def step() -> bool:
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        return bool(terminated or truncated)

    return (
        step,
        lambda: env.reset(seed=0),
        "10 Hz; depth 350 x 350 px with noise, quality, angle and width maps",
    )


def robosuite() -> tuple[Step, Callable[[], Any], str]:
    """Lift with the Panda's eye-in-hand camera, depth, at its own 20 Hz."""
    import numpy as np

    env = importlib.import_module("robosuite").make(
        "Lift",
        robots="Panda",
        has_renderer=False,
        has_offscreen_renderer=True,
        use_camera_obs=True,
        camera_names="robot0_eye_in_hand",
        camera_heights=SIZE,
        camera_widths=SIZE,
        camera_depths=True,
        control_freq=20,
        horizon=50,  # after that the arm may have turned its camera to where there is nothing to draw
    )
    rng = np.random.default_rng(0)
    low, high = env.action_spec

    def step() -> bool:
        return bool(env.step(rng.uniform(low, high))[2])

    return step, env.reset, f"20 Hz; depth and colour {SIZE} x {SIZE} px, no noise, no detector"


def panda_gym() -> tuple[Step, Callable[[], Any], str]:
    """PandaPickAndPlace: joint states and positions, no image."""
    import gymnasium

    importlib.import_module("panda_gym")  # registers its environments
    env = gymnasium.make("PandaPickAndPlace-v3")
    env.action_space.seed(0)

    def step() -> bool:
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        return bool(terminated or truncated)

    return step, lambda: env.reset(seed=0), "25 Hz; state, no image"


PROBES: dict[str, tuple[str, Callable[[], tuple[Step, Callable[[], Any], str]]]] = {
    "mpgrasp, oracle": ("mpgrasp", lambda: mpgrasp("oracle")),
    "mpgrasp, dhrnet": ("mpgrasp", lambda: mpgrasp("dhrnet")),
    "robosuite": ("robosuite", robosuite),
    "panda-gym": ("panda-gym", panda_gym),
}
"""Distribution and maker of each environment."""


def measure(name: str, steps: int) -> dict[str, Any]:
    """CPU time of steps with random actions; that of resets is not counted.

    The median is of a usual step. The mean has mpgrasp's last steps in it too, which grasp and lift.
    """
    distribution, make = PROBES[name]
    step, reset, content = make()
    reset()
    for _ in range(WARM_UP):
        if step():
            reset()
    times = []
    for _ in range(steps):
        start = time.process_time()
        over = step()
        times.append(1e3 * (time.process_time() - start))
        if over:
            reset()
    return {
        "environment": name,
        "version": version(distribution),
        "step": content,
        "steps": steps,
        "median_ms": statistics.median(times),
        "mean_ms": statistics.fmean(times),
    }


def main() -> int:
    """Time the environment that the command line names, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("environment", choices=PROBES)
    parser.add_argument("--steps", type=int, default=100)
    options = parser.parse_args()
    print(json.dumps(measure(options.environment, options.steps)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
