"""Verdict on an execution: the outcome, and the reason for it in a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mpgrasp.motion.execution_state import ExecutionState
from mpgrasp.motion.reflex import Reflex
from mpgrasp.outcome import Outcome

ExecutionOutcome = Literal[
    Outcome.SUCCESS, Outcome.REFLEX, Outcome.COLLISION, Outcome.MISSED, Outcome.SLIPPED
]
"""Outcomes that an execution can have."""


@dataclass(frozen=True, kw_only=True)
class ExecutionResult:
    """Outcome of one execution, and what was measured on the way."""

    outcome: ExecutionOutcome
    reason: str
    """The same in a sentence."""
    lifted: str | None = None
    """The object that was lifted, held and shaken."""
    between: tuple[str, ...] = ()
    """Objects that the fingers clamped when the lift began."""
    reflex: Reflex | None = None
    contact_height: float | None = None
    """Height of the finger tips over the table at first contact [m]; None without contact."""
    planned_height: float = np.nan
    """Height of the finger tips over the table that was aimed at [m]."""
    tip_height: float = np.nan
    """Height of the finger tips over the table when they closed [m]."""
    width: float = np.nan
    """Opening of the gripper when the lift began [m]."""
    duration: float = 0.0
    """Simulated time of the whole execution [s]."""


def judge(state: ExecutionState) -> ExecutionResult:
    """Judge an execution after its last phase, or after the protective stop that ended it.

    Success takes an object that both fingers clamp, `success_height` or more above its place of rest.
    """
    outcome, reason, lifted = _verdict(state)
    return ExecutionResult(
        outcome=outcome,
        reason=reason,
        lifted=lifted,
        between=state.between,
        reflex=state.driver.reflex,
        contact_height=state.contact_height,
        planned_height=state.planned,
        tip_height=state.tip_height,
        width=state.width,
        duration=state.simulation.time - state.start,
    )


def _verdict(state: ExecutionState) -> tuple[ExecutionOutcome, str, str | None]:
    """Outcome, reason, and the object that was lifted."""
    c, reflex, rest = state.config, state.driver.reflex, state.rest
    if reflex is not None:
        return Outcome.REFLEX, f"{reflex} while in phase {state.phase}", None
    raised = [name for name in rest if state.height_of(name) - rest[name] >= c.success_height]
    for name in sorted(state.simulation.held()):
        if name in raised:
            return Outcome.SUCCESS, f"{name} is held", name
    if state.between:
        names = ", ".join(state.between)
        return Outcome.SLIPPED, f"{names} was between the fingers and was lost", None
    met, planned = state.contact_height, state.planned
    if met is not None and met > max(c.support_band, planned + 0.002):
        reason = (
            f"the fingers met something {1e3 * met:.1f} mm over the table, "
            f"planned were {1e3 * max(planned, 0.0):.1f} mm"
        )
        return Outcome.COLLISION, reason, None
    if raised:
        # a ring on a hook: no grasp, for nothing but luck keeps it there
        reason = f"{', '.join(raised)} came up hanging on the fingers, which do not clamp it"
        return Outcome.MISSED, reason, None
    return Outcome.MISSED, "nothing stood between the closed fingers", None
