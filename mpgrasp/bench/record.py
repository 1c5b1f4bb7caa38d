"""Rows of result files, with the lines of episodes.jsonl, and the words Method, Cell and Task.

A row is read and written here and nowhere else. Its keys are those of the file; an unknown key, a missing
one or a value of another type is an error. benchmarks/README.md explains them to users.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeVar

import msgspec

from mpgrasp.exceptions import ConfigError
from mpgrasp.files.json_values import json_value, one_line
from mpgrasp.outcome import Outcome
from mpgrasp.suite import base_name

ERROR: Final = "error"
"""`outcome` of an episode that could not be played: it is no failure of a grasp, and is counted apart."""

Row = TypeVar("Row", bound="Record")
Number = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
"""A whole number from 0 that fits into 63 bits."""


_LONGEST = 80  # characters of a point of a sweep in the name of a file


class Method(NamedTuple):
    """A detector and a controller that play together."""

    detector: str
    """Registry name or import path."""
    controller: str
    """Registry name or import path."""

    def __str__(self) -> str:
        return f"{self.detector}/{self.controller}"


class Cell(NamedTuple):
    """A method in a suite: one row of a table of results."""

    suite: str
    detector: str
    controller: str

    @property
    def method(self) -> Method:
        """Detector and controller of the cell."""
        return Method(self.detector, self.controller)

    def __str__(self) -> str:
        return f"{self.suite}/{self.detector}/{self.controller}"


class Task(NamedTuple):
    """One episode of one cell; no two lines of a run have the same task."""

    suite: str
    episode: int
    detector: str
    controller: str

    @property
    def cell(self) -> Cell:
        """The cell that the episode belongs to."""
        return Cell(self.suite, self.detector, self.controller)

    @property
    def stem(self) -> str:
        """File name, without ending, of what is recorded of this episode."""
        suite = self.suite
        if suite != base_name(suite):  # points that differ in what no file name has, and long ones
            suite = f"{_in_files(suite)[:_LONGEST]}-{zlib.crc32(suite.encode()):08x}"
        return _in_files(f"{suite}-{self.detector}-{self.controller}-{self.episode:04d}")

    def __str__(self) -> str:
        return f"episode {self.episode} of {self.suite} ({self.detector}, {self.controller})"


def _in_files(name: str) -> str:
    """Return a name without what makes trouble in the name of a file."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name)


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A row of a result file, or a part of one."""

    def as_row(self) -> dict[str, Any]:
        """Plain values by key, as they stand in the file: floats have 9 digits, and NaN is None."""
        row: dict[str, Any] = json_value(msgspec.to_builtins(self))
        return row


class Stop(Record, frozen=True, kw_only=True):
    """A protective stop: `mpgrasp.motion.reflex.Reflex` in plain values."""

    limit: str
    """Name of the limit that was broken."""
    joint: int | None
    """Number of the arm's joint, from 1; None where the limit is not one of a joint."""
    value: float | None
    bound: float | None
    time: float
    """Simulated time since the scene began [s]."""
    demanded: bool
    text: str
    """The same in a sentence."""


class ExecutedGrasp(Record, frozen=True, kw_only=True):
    """The grasp that was executed: `mpgrasp.grasp.Grasp` in plain values."""

    position: tuple[float, float, float]
    """World [m]."""
    angle: float
    """[rad]"""
    width: float
    """[m]"""
    quality: float | None


class Reach(Record, frozen=True, kw_only=True):
    """Measurements of one attempt, or of an episode as a whole; None where a value was not measured."""

    outcome: Outcome
    success: bool
    object: str
    sim_time_s: float
    ticks: int
    reflex: Stop | None
    """The first protective stop."""
    min_singular_value: float | None
    near_singularity_s: float | None
    path_length_m: float | None
    jerk_rms: float | None
    spectral_arc_length: float | None
    first_detection_s: float | None
    blind_drift_m: float | None
    grasp: ExecutedGrasp | None

    def __post_init__(self) -> None:
        if self.success != (self.outcome is Outcome.SUCCESS):
            raise ValueError(f"outcome {self.outcome.value!r} beside success {self.success}")
        if self.ticks < 0 or not self.sim_time_s >= 0:
            raise ValueError("a time or a number of ticks below 0")


class Pick(Reach, frozen=True, kw_only=True):
    """One attempt of a clearing."""

    start_s: float
    end_s: float


class GraspLine(Reach, frozen=True, kw_only=True):
    """Line of an episode with one grasp."""

    suite: str
    seed: Number
    scene_seed: Number
    episode: Number
    detector: str
    controller: str
    timing: dict[str, float | None]
    """Median wall time of each stage of a control tick, and `episode`, that of the whole episode [ms]."""
    state_hash: str

    @property
    def task(self) -> Task:
        """Episode that the line is about."""
        return Task(self.suite, self.episode, self.detector, self.controller)

    @property
    def all_stops(self) -> tuple[Stop, ...]:
        """All protective stops, in their order."""
        return () if self.reflex is None else (self.reflex,)


class ClearingLine(GraspLine, frozen=True, kw_only=True):
    """Line of an episode in which a table was to be cleared."""

    failures: dict[str, int]
    """Attempts that put nothing into the basket, by outcome."""
    in_basket: tuple[str, ...]
    knocked_off: tuple[str, ...]
    left: tuple[str, ...]
    stops: tuple[Stop, ...]
    time_limit_s: float
    picks: tuple[Pick, ...]

    @property
    def all_stops(self) -> tuple[Stop, ...]:
        return self.stops


class ErrorLine(Record, frozen=True, kw_only=True):
    """Line of an episode that could not be played."""

    suite: str
    seed: Number
    scene_seed: Number
    episode: Number
    detector: str
    controller: str
    outcome: Literal["error"] = ERROR
    success: None = None
    error: str
    """Cause, in a sentence."""
    traceback: str
    """Tracebacks of all attempts; in episodes.jsonl, the name of the file that holds them."""

    @property
    def task(self) -> Task:
        """Episode that the line is about."""
        return Task(self.suite, self.episode, self.detector, self.controller)


PlayedLine = GraspLine | ClearingLine
Line = PlayedLine | ErrorLine
Cells = dict[Cell, Sequence[Line]]


def line_of(row: Mapping[str, Any]) -> Line:
    """The line that plain values describe.

    Raises:
        ConfigError: an unknown or a missing key, or a value of another type; it names the key.
    """
    if row.get("outcome") == ERROR:
        return record_of(ErrorLine, row)
    return record_of(ClearingLine if "picks" in row else GraspLine, row)


def record_of(kind: type[Row], row: Mapping[str, Any]) -> Row:
    """A row of that kind from plain values.

    Raises:
        ConfigError: an unknown or a missing key, or a value of another type; it names the key.
    """
    try:
        return msgspec.convert(row, kind)
    except msgspec.ValidationError as error:
        raise ConfigError(f"cannot be used: {error}") from error


def text_of(line: Line) -> str:
    """The line as it stands in episodes.jsonl: sorted keys, line end; equal lines, equal bytes."""
    return one_line(line.as_row())


def played(lines: Iterable[Line]) -> Iterator[PlayedLine]:
    """Lines of episodes that were played, be it without success."""
    return (line for line in lines if not isinstance(line, ErrorLine))
