"""Outcome of an episode, an execution or a trial: the words that everything uses."""

from __future__ import annotations

from enum import StrEnum


class Outcome(StrEnum):
    """Ending of an episode, an execution or a trial."""

    SUCCESS = "success"
    NO_GRASP = "no_grasp"
    """The controller had seen nothing to grasp."""
    REFLEX = "reflex"
    """A protective stop, named in `EpisodeResult.reflex`."""
    COLLISION = "collision"
    """The fingers landed on something on their way down and came up empty."""
    MISSED = "missed"
    """Nothing stood between the fingers when they had closed."""
    SLIPPED = "slipped"
    """Something was between the fingers and was lost."""
    DROPPED = "dropped"
    """Something was lifted and did not get into the basket; where there is one."""
    KNOCKED_OFF = "knocked_off"
    """Nothing is left on the table, and something of it lies beside the basket; where tables are cleared."""
    TIMEOUT = "timeout"
    """The reach did not end in time."""
