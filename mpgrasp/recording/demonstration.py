"""An episode's reach as a demonstration: what was seen, what was done, and how it ended.

Observations and actions are those of `mpgrasp.env`, so that a policy that learns from demonstrations is tried
there as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.recording.policy_view import action_of, observed
from mpgrasp.recording.recorder import NullRecorder, TickRecord
from mpgrasp.scene.simulation import Simulation


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstration:
    """T control ticks of an episode, up to the one after which the grasp was executed or the arm stopped."""

    observations: dict[str, NDArray[np.float32]]
    """By name, each (T, ...): as `mpgrasp.recording.policy_view.Observed`, and `q` (T, 7), joints [rad]."""
    actions: NDArray[np.float32]
    """(T, 4) in [-1, 1], what the controller asked for, in units of `ACTION_SCALE`."""
    success: bool
    """True if the object was lifted, held and shaken: the reward of the last tick; of all others it is 0."""
    about: dict[str, object] = field(default_factory=dict)
    """The episode's line in episodes.jsonl."""

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def rewards(self) -> NDArray[np.float32]:
        """Reward (T,) of each tick."""
        rewards = np.zeros(len(self), np.float32)
        rewards[-1] = self.success
        return rewards

    @property
    def dones(self) -> NDArray[np.bool_]:
        """Ends (T,): true at the last tick alone."""
        dones = np.zeros(len(self), bool)
        dones[-1] = True
        return dones


class DemonstrationRecorder(NullRecorder):
    """Gathers one episode; ask for it once the episode is over."""

    def __init__(self) -> None:
        self._seen: list[dict[str, NDArray[np.float32]]] = []
        self._actions: list[NDArray[np.float32]] = []
        self._start = 0.0
        self._now: tuple[FloatArray, FloatArray, float] | None = None

    def start(self, simulation: Simulation) -> None:
        self._start = simulation.time
        self._remember(simulation)

    def tick(self, record: TickRecord) -> None:
        seen, command = record.grasp_map, record.command
        if record.frame is not None and seen is not None and command is not None and not command.done:
            assert self._now is not None
            T, q, time = self._now  # a record is made when the tick is over, its image when it begins
            view = observed(record.frame, seen, T, time - self._start)
            self._seen.append({**view, "q": q.astype(np.float32)})
            self._actions.append(action_of(command.twist))
        self._remember(record.simulation)

    def demonstration(self, *, success: bool, about: dict[str, object] | None = None) -> Demonstration:
        """Return what was gathered.

        Args:
            success: the verdict.
            about: the episode's line.

        Raises:
            ConfigError: the arm did not move for a single tick.
        """
        if not self._actions:
            raise ConfigError("nothing to learn from", got="no control tick", allowed="a reach")
        names = self._seen[0]
        return Demonstration(
            observations={name: np.stack([view[name] for view in self._seen]) for name in names},
            actions=np.stack(self._actions),
            success=success,
            about=about or {},
        )

    def _remember(self, simulation: Simulation) -> None:
        self._now = simulation.T_world_tcp, simulation.q, simulation.time
