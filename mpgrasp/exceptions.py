"""Errors that say what is wrong, what was got and what is allowed.

A failed grasp is an `Outcome`, never an exception. These are for input that cannot be used at all.
"""

from __future__ import annotations

from collections.abc import Iterable


class MpgraspError(Exception):
    """Base of every error that mpgrasp raises on purpose.

    Args:
        wrong: what is wrong, as a short clause ("unknown suite"); an error that is raised again, as vector
            environments do in their parent, gives its own words.
        got: the offending value, shown with `repr`.
        allowed: what would have worked; a sentence, or the allowed values.
    """

    def __init__(
        self, wrong: str | Exception, *, got: object = None, allowed: str | Iterable[object] | None = None
    ) -> None:
        parts = [str(wrong)]
        if got is not None:
            parts.append(f"got {got!r}")
        if allowed is not None:
            text = allowed if isinstance(allowed, str) else ", ".join(str(a) for a in allowed)
            parts.append(f"allowed: {text}")
        super().__init__("; ".join(parts))


class ConfigError(MpgraspError, ValueError):
    """A setting or argument outside of what it may be."""


class AssetError(MpgraspError):
    """A mesh, model or declaration file that is missing or cannot be used."""


class WeightsError(MpgraspError):
    """A weights file that is missing, unreadable or made for another network."""


class CameraError(MpgraspError):
    """A camera backend that is not to be had on this machine."""


class OutputError(MpgraspError):
    """A directory or file that cannot be written."""


class PlugInError(MpgraspError):
    """What a detector or a controller returned or did that cannot be used; it names the one at fault."""


class SimulationError(MpgraspError):
    """A simulation that the simulator itself has warned of, or broken off: there is no result."""
