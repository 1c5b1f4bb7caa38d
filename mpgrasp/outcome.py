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
    TIMEOUT = "timeout"
    """The reach did not end in time."""
