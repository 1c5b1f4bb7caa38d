"""Execution of a chosen grasp by the arm: all phases, and the verdict."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import Grasp
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.execution_state import ExecutionState
from mpgrasp.motion.heading import reachable_yaw
from mpgrasp.motion.phases import PHASES
from mpgrasp.motion.verdict import ExecutionResult, judge

OnPhase = Callable[[str, ArmDriver], None]


def execute_grasp(
    driver: ArmDriver,
    grasp: Grasp,
    config: ExecutionConfig | None = None,
    on_tick: OnPhase | None = None,
    *,
    rng: np.random.Generator | None = None,
) -> ExecutionResult:
    """Grasp, lift, hold, shake and judge.

    Args:
        driver: drives the arm from wherever it is.
        grasp: what to grasp; its position lies on the seen surface.
        config: speeds, forces, times and heights.
        on_tick: is told the phase and the driver on every tick of the velocity loop.
        rng: source of the noise on forces; one of a fixed seed by default.

    Returns:
        The verdict. A failed grasp is an outcome, never an exception.

    Raises:
        ConfigError: a grasp that is not finite.
    """
    check_finite(grasp)
    told = None if on_tick is None else lambda phase: on_tick(phase, driver)
    config = config or ExecutionConfig()
    yaw = reachable_yaw(driver, grasp, config)
    state = ExecutionState(driver, grasp, config, yaw=yaw, on_tick=told, rng=rng)
    state.play(PHASES)
    return judge(state)


def check_finite(grasp: Grasp) -> None:
    """Raise ConfigError for a grasp that is not finite."""
    if not np.all(np.isfinite([*grasp.position, grasp.angle, grasp.width])):
        raise ConfigError("grasp is not finite", got=(list(grasp.position), grasp.angle, grasp.width))
