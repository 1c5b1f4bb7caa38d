"""What the episodes of a cell add up to, in one pass over their lines and without keeping them."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterable

from mpgrasp.bench.record import ClearingLine, ErrorLine, Line, PlayedLine, Reach
from mpgrasp.episode.result import MOTION
from mpgrasp.outcome import Outcome

SINGULARITY = 0.05
"""Smallest singular value of the tool Jacobian (m, rad) below which a stop counts as one of a singularity.

At 0.1 m/s the worst direction then asks a joint for 0.1 / 0.05 = 2 rad/s of the 2.175 that it may have. In
the runs that were published when this was chosen, 5 of 6,497 attempts without a stop came below it (59 below
0.07), and 42 of 143 with one, all stopped by the velocity or acceleration of joint 3, 4 or 5.
"""


class Tally:
    """Counts and values of the episodes of a cell."""

    def __init__(self, lines: Iterable[Line] = ()) -> None:
        self.n = self.errors = self.successes = 0
        """Episodes that were played, that could not be, and that succeeded."""
        self.times = array("d")
        """Simulated times, of clearings cut off at their limit [s]."""
        self.limit: float | None = None
        """Least time at which an episode was broken off [s]; None where none was."""
        self.motion = {key: array("d") for key in MOTION}
        """Values of `MOTION`, of those that were measured."""
        self.stops: Counter[str] = Counter()
        """Protective stops by the limit that was broken."""
        self.failures: Counter[str] = Counter()
        self.objects: dict[str, list[int]] = {}
        """By object: grasps, and those that succeeded."""
        self.singular: int | None = None
        """Attempts that a stop ended in a singular posture; None where nothing was measured."""
        self.clearings = self.in_basket = self.knocked_off = self.left = 0
        self.attempts: Counter[Outcome] = Counter()
        """Attempts of clearings by outcome."""
        for line in lines:
            self._add(line)

    def _add(self, line: Line) -> None:
        if isinstance(line, ErrorLine):
            self.errors += 1
            return
        self.n += 1
        self.successes += line.success
        self.times.append(restricted_time(line))
        limit = limit_hit(line)
        if limit is not None:
            self.limit = limit if self.limit is None else min(self.limit, limit)
        for key, values in self.motion.items():
            if (value := getattr(line, key)) is not None:
                values.append(value)
        self.stops.update(stop.limit for stop in line.all_stops)
        if not line.success:
            self.failures[line.outcome.value] += 1
        counts = self.objects.setdefault(line.object, [0, 0])
        counts[0] += 1
        counts[1] += line.success
        for attempt in line.picks if isinstance(line, ClearingLine) else (line,):
            self._see_posture(attempt)
        if isinstance(line, ClearingLine):
            self.clearings += 1
            self.attempts.update(pick.outcome for pick in line.picks)
            self.in_basket += len(line.in_basket)
            self.knocked_off += len(line.knocked_off)
            self.left += len(line.left)

    def _see_posture(self, attempt: Reach) -> None:
        if attempt.min_singular_value is not None:
            singular = attempt.min_singular_value < SINGULARITY and attempt.reflex is not None
            self.singular = (self.singular or 0) + singular


def limit_hit(line: PlayedLine) -> float | None:
    """Time at which an episode was broken off [s]; None where it was not.

    A table that was not cleared, for whatever reason, counts as a hit of the limit that its line gives.
    """
    if isinstance(line, ClearingLine) and not line.success:
        return line.time_limit_s
    return line.sim_time_s if line.outcome is Outcome.TIMEOUT else None


def restricted_time(line: PlayedLine, limit: float | None = None) -> float:
    """Simulated time of an episode cut off at its limit, or else at `limit` [s].

    Who has not got to the end took at least as long as is allowed.
    """
    allowed = line.time_limit_s if isinstance(line, ClearingLine) else limit
    if allowed is None:
        return line.sim_time_s
    return min(line.sim_time_s, allowed) if line.success else allowed
