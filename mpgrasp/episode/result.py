"""Results of episodes: their endings, and what was measured along the way."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from statistics import median
from typing import TYPE_CHECKING, Any

from mpgrasp.files.json_values import json_value
from mpgrasp.outcome import Outcome

if TYPE_CHECKING:
    from mpgrasp.grasp import Grasp
    from mpgrasp.motion.reflex import Reflex

REACH = ("path_length_m", "jerk_rms", "spectral_arc_length", "first_detection_s", "blind_drift_m")
"""Fields of an `EpisodeResult` that say how the arm moved during its reach."""
MOTION = ("min_singular_value", "near_singularity_s", *REACH)
"""Fields that say how the arm moved, from the start to the end."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeResult:
    """Result of one episode."""

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
        """True if an object was lifted, held and shaken without being lost."""
        return self.outcome is Outcome.SUCCESS

    def as_record(self) -> dict[str, Any]:
        """Return a JSON-ready dict with one key per field and `success`; floats have 9 digits."""
        record: dict[str, Any] = json_value(
            {
                **{name: getattr(self, name) for name in self.__dataclass_fields__},
                "outcome": self.outcome.value,
                "success": self.success,
                "reflex": None if self.reflex is None else {**asdict(self.reflex), "text": str(self.reflex)},
                "grasp": None if self.grasp is None else asdict(self.grasp),
            }
        )
        return record


@dataclass(frozen=True, kw_only=True, eq=False)
class Pick:
    """One attempt of a clearing: reach, grasp, and what it took to be ready for the next one."""

    result: EpisodeResult
    """Judged by where the object is in the end: a success lies in the basket."""
    start_s: float
    """Time at which the reach began, since the start of the episode [s]."""
    end_s: float
    """Time at which the arm was back at its start [s]."""

    def as_record(self) -> dict[str, Any]:
        """Return a JSON-ready dict: the keys of a single grasp but for timing and state, and the times."""
        record = self.result.as_record()
        for key in ("timing", "state_hash"):
            del record[key]
        return {**record, "start_s": json_value(self.start_s), "end_s": json_value(self.end_s)}


@dataclass(frozen=True, kw_only=True, eq=False)
class ClearingResult:
    """Result of one episode in which a table was to be cleared."""

    outcome: Outcome
    """success: all objects are in the basket; knocked_off: none is left in the workspace, but some lie
    elsewhere; timeout; or no_grasp: nothing more was found to grasp."""
    picks: tuple[Pick, ...]
    """All attempts, in their order."""
    in_basket: tuple[str, ...]
    knocked_off: tuple[str, ...]
    """Objects that lie below the table, or on it beyond the workspace."""
    left: tuple[str, ...]
    """Objects that are still in the workspace."""
    sim_time_s: float
    """Simulated time from the start until the arm was back from its last attempt [s]."""
    time_limit_s: float
    """[s]"""
    ticks: int
    """Control ticks of all reaches."""
    stops: tuple[Reflex, ...]
    """All protective stops, those of carrying and returning included."""
    min_singular_value: float
    """Smallest singular value of the tool Jacobian along the way, m and rad."""
    near_singularity_s: float
    """Time below the warning level [s]."""
    timing: Mapping[str, float]
    """Median wall time of each stage of a tick [ms]."""
    state_hash: str
    """SHA-256 of the final simulation state."""

    @property
    def success(self) -> bool:
        """True if all objects are in the basket."""
        return self.outcome is Outcome.SUCCESS

    @property
    def failures(self) -> dict[str, int]:
        """Number of attempts that put nothing into the basket, by cause."""
        causes = Counter(pick.result.outcome.value for pick in self.picks if not pick.result.success)
        return dict(sorted(causes.items()))

    def as_record(self) -> dict[str, Any]:
        """Return a JSON-ready dict with the keys of a single grasp's, and those of a clearing.

        How the arm moved (`REACH`) are medians over the attempts in which it was measured; `reflex` is the
        first stop.
        """
        reaches = {
            key: [value for pick in self.picks if _is_measured(value := getattr(pick.result, key))]
            for key in REACH
        }
        names = ("sim_time_s", "time_limit_s", "ticks", "min_singular_value", "near_singularity_s",
                 "in_basket", "knocked_off", "left", "failures", "timing", "state_hash")  # fmt: skip
        stops = [{**asdict(stop), "text": str(stop)} for stop in self.stops]
        record: dict[str, Any] = json_value(
            {
                **{name: getattr(self, name) for name in names},
                **{key: median(values) if values else None for key, values in reaches.items()},
                "outcome": self.outcome.value,
                "success": self.success,
                "object": f"{len(self.in_basket) + len(self.knocked_off) + len(self.left)} objects",
                "grasp": None,
                "reflex": stops[0] if stops else None,
                "stops": stops,
                "picks": [pick.as_record() for pick in self.picks],
            }
        )
        return record


def _is_measured(value: float | None) -> bool:
    """True for what a median can be taken of: neither None nor NaN."""
    return value is not None and math.isfinite(value)
