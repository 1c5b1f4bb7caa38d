"""Recorders of episodes: what they are told, one that keeps nothing, and one that tells several others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from mpgrasp.depth import DepthFrame
from mpgrasp.exceptions import OutputError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, GraspMap

if TYPE_CHECKING:
    from mpgrasp.controllers.controller import Command
    from mpgrasp.scene.simulation import Simulation


@dataclass(frozen=True, kw_only=True, eq=False)
class TickRecord:
    """One instant of an episode. Fields are None where the phase has no such thing."""

    phase: str
    """reach, pregrasp, descend, close, lift, hold or shake."""
    simulation: Simulation
    """The live world: read poses from it, change nothing."""
    frame: DepthFrame | None
    grasp_map: GraspMap | None
    diagnostics: Mapping[str, FloatArray | float | bool]
    """`Controller.diagnostics()`: grids (ny, nx) such as entropy and utility, and scalars."""
    twist_commanded: FloatArray
    """(6,) world axes [m/s, rad/s]."""
    twist_achieved: FloatArray
    """(6,) world axes [m/s, rad/s]."""
    min_singular_value: float
    manipulability: float
    grasp: Grasp | None
    """The grasp in hand, once one is chosen."""
    event: str | None = None
    """Reflex or outcome, in words."""
    command: Command | None = None
    """What the controller has asked for in a tick of the reach."""


class Recorder(Protocol):
    """Keeps what it is shown of an episode."""

    def start(self, simulation: Simulation) -> None: ...

    def tick(self, record: TickRecord) -> None: ...

    def finish(self, event: str) -> None:
        """The episode is over; `event` is the outcome in words."""
        ...


class NullRecorder:
    """Keeps nothing."""

    def start(self, simulation: Simulation) -> None:
        pass

    def tick(self, record: TickRecord) -> None:
        pass

    def finish(self, event: str) -> None:
        pass


class TeeRecorder:
    """Shows everything to several recorders, in their order."""

    def __init__(self, *recorders: Recorder) -> None:
        self.recorders = recorders

    def start(self, simulation: Simulation) -> None:
        for recorder in self.recorders:
            recorder.start(simulation)

    def tick(self, record: TickRecord) -> None:
        for recorder in self.recorders:
            recorder.tick(record)

    def finish(self, event: str) -> None:
        for recorder in self.recorders:
            recorder.finish(event)


class LenientRecorder:
    """Shows everything to a recorder until that fails to write: the episode is worth more than its recording.

    Args:
        make: makes the recorder; may fail likewise.
        lost: is told what went wrong, once.
    """

    def __init__(self, make: Callable[[], Recorder], lost: Callable[[OutputError], object]) -> None:
        self._lost = lost
        self._recorder: Recorder = NullRecorder()
        self._try(lambda: setattr(self, "_recorder", make()))

    def start(self, simulation: Simulation) -> None:
        self._try(lambda: self._recorder.start(simulation))

    def tick(self, record: TickRecord) -> None:
        self._try(lambda: self._recorder.tick(record))

    def finish(self, event: str) -> None:
        self._try(lambda: self._recorder.finish(event))

    def _try(self, action: Callable[[], object]) -> None:
        try:
            action()
        except OutputError as error:
            self._recorder = NullRecorder()
            self._lost(error)


def claim_file(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    """Make sure, before an episode is played, that its recording can be written; creates directories.

    What is there already stays as it is, and a file that is not there does not come to be.

    Raises:
        OutputError: another suffix, or a place that cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in suffixes:
        raise OutputError("unknown kind of recording", got=str(path), allowed=suffixes)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        is_new = not path.exists()
        with path.open("ab"):
            pass
        if is_new:
            path.unlink()
    except OSError as error:
        raise OutputError(
            f"a recording cannot be written: {error.strerror}", got=str(path), allowed="a writable directory"
        ) from error
    return path
