"""How an episode ended, and what was measured along the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from mpgrasp.grasp import Grasp
from mpgrasp.plain import plain
from mpgrasp.reflex import Reflex


class Outcome(StrEnum):
    """How an episode ended."""

    SUCCESS = "success"
    NO_GRASP = "no_grasp"
    """The controller had seen nothing to grasp."""
    REFLEX = "reflex"
    """A protective stop, named in `EpisodeResult.reflex`."""
    COLLISION = "collision"
    """The fingers landed on something on their way down and came up empty."""
    MISSED = "missed"
    """Nothing stood between the pads when they had closed."""
    SLIPPED = "slipped"
    """Something was between the pads and was lost."""
    TIMEOUT = "timeout"
    """The reach did not end in time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeResult:
    """What happened in one episode."""

    outcome: Outcome
    object: str
    """The object that was lifted, or else the one nearest to the chosen grasp, or the scene's first."""
    sim_time_s: float
    """Simulated time from the start to the end of the lift, hold and shake [s]."""
    ticks: int
    """Control ticks of the reach."""
    reflex: Reflex | None
    min_singular_value: float
    """Smallest singular value of the tool Jacobian along the way, m and rad."""
    near_singularity_s: float
    """Time below the warning level [s]."""
    path_length_m: float
    """Way of the tool point during the reach [m]."""
    jerk_rms: float
    """Root mean square jerk of the tool point during the reach [m/s3]."""
    spectral_arc_length: float
    """Smoothness of the reach: about -1.4 for one smooth movement, lower the more it stops and starts; NaN
    without a reach."""
    first_detection_s: float | None
    """Time of the first look whose quality map had a peak [s]; None if none had."""
    blind_drift_m: float
    """Horizontal way of the tool point before that [m]."""
    grasp: Grasp | None
    """The grasp that was executed."""
    timing: Mapping[str, float]
    """Median wall time of each stage of a tick [ms]."""
    state_hash: str
    """SHA-256 of the final simulation state."""

    @property
    def success(self) -> bool:
        """Whether an object was lifted, held and shaken without being lost."""
        return self.outcome is Outcome.SUCCESS

    def as_record(self) -> dict[str, Any]:
        """A JSON-ready dict with one key per field and `success`; floats have 9 digits."""
        return plain(
            {
                **{name: getattr(self, name) for name in self.__dataclass_fields__},
                "outcome": self.outcome.value,
                "success": self.success,
                "reflex": None if self.reflex is None else {**asdict(self.reflex), "text": str(self.reflex)},
                "grasp": None if self.grasp is None else asdict(self.grasp),
            }
        )
