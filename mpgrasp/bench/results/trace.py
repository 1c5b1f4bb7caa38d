"""Trace of an episode, kept for the report: way, singular values, entropy map, and a few stills.

Ways are kept of the first `KEPT` episodes of each cell, about 2 kB each; stills and the entropy map of its
first success and its first failure, about 45 kB.
"""

from __future__ import annotations

import glob
import io
import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mpgrasp.bench.record import PlayedLine
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.geometry import FloatArray

KEPT = 10
"""Episodes of each cell, the first ones, whose traces stay beside those with stills."""

Arrays = Mapping[str, Any]
"""Arrays of a file by name."""

_STILLS = "-stills"  # in the name of a file with pictures
_NAME = re.compile(rf"(?P<cell>.+)-(?P<episode>\d+)-(?P<ending>success|failure)(?P<stills>{_STILLS})?\.npz")


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """Way, singular values and stills of one episode."""

    times: FloatArray
    """(n,) since the start [s]."""
    positions: FloatArray
    """(n, 3) of the tool point [m], world frame."""
    singular_values: FloatArray
    """(n,), the smallest of the tool Jacobian."""
    entropy: FloatArray | None
    """(ny, nx) of the last look [nat]; None where the controller has no such map."""
    stills: list[bytes] = field(default_factory=list)
    """WebP pictures; the corner shows the quality map where there was one."""
    still_times: list[float] = field(default_factory=list)
    still_phases: list[str] = field(default_factory=list)


def write_trace(
    folder: Path, line: PlayedLine, way: Callable[[], Arrays], pictures: Callable[[], Arrays]
) -> None:
    """Write way and stills of an episode, each if it is wanted; what is not wanted is not asked for.

    Args:
        folder: of the traces; made if need be.
        line: of the episode.
        way: gives times, positions and singular_values, as in `Trace`.
        pictures: gives still_0 and so on, still_times, still_phases, and entropy if there is any.

    Raises:
        OutputError: a file cannot be written.
    """
    stem, ending = line.task.stem, _ending(line)
    cell, _, _ = stem.rpartition("-")
    hashed = {"state_hash": np.array(line.state_hash)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file in folder.glob(f"{glob.escape(stem)}-{_other(ending)}*.npz"):
            file.unlink(missing_ok=True)  # of an earlier run that ended otherwise
        before = (f.episode for f in _files(folder) if (f.cell, f.ending) == (cell, ending))
        first = min(before, default=line.episode) >= line.episode
        if first or line.episode < KEPT:
            _write(folder / f"{stem}-{ending}.npz", {**hashed, **way()})
        if first:
            _write(folder / f"{stem}-{ending}{_STILLS}.npz", {**hashed, **pictures()})
    except OSError as error:
        raise OutputError(
            f"a trace cannot be written ({error.strerror or error})",
            got=str(folder),
            allowed="a directory one may write to",
        ) from error


def _write(file: Path, content: Arrays) -> None:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **content)
    replace_file(file, buffer.getvalue())


def read_trace(folder: Path, line: PlayedLine) -> Trace | None:
    """The trace of the episode that a line of episodes.jsonl tells of; None if none was kept.

    Args:
        folder: of the traces.
        line: of the episode; its `success` and `state_hash` must be the trace's.

    Raises:
        OutputError: a file that is no trace.
    """
    name = f"{line.task.stem}-{_ending(line)}"
    way, seen = (_read(folder / f"{name}{kind}.npz", line.state_hash) for kind in ("", _STILLS))
    if way is None:
        return None
    seen = seen or {}
    entropy = seen.get("entropy")
    try:
        return Trace(
            times=way["times"].astype(float),
            positions=way["positions"].astype(float),
            singular_values=way["singular_values"].astype(float),
            entropy=None if entropy is None else entropy.astype(float),
            stills=[seen[f"still_{k}"].tobytes() for k in range(len(seen.get("still_times", ())))],
            still_times=[float(time_s) for time_s in seen.get("still_times", ())],
            still_phases=[str(phase) for phase in seen.get("still_phases", ())],
        )
    except KeyError as error:
        raise OutputError(f"a trace lacks {error}", got=str(folder / name)) from error


def _read(file: Path, state_hash: str) -> Arrays | None:
    """Arrays of a file; None if there is none, or one of another run."""
    if not file.is_file():
        return None
    try:
        with np.load(file, allow_pickle=False) as content:
            arrays = {key: content[key] for key in content.files}
        return arrays if str(arrays["state_hash"]) == state_hash else None
    except (OSError, ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile) as error:
        raise OutputError("not a trace", got=str(file), allowed="a file that mpgrasp.bench wrote") from error


def prune_traces(folder: Path) -> None:
    """Delete what is not to be kept, so that the folder is the same in whatever order episodes were played.

    Raises:
        OutputError: a file cannot be deleted.
    """
    files = _files(folder)
    first: dict[tuple[str, str], int] = {}
    for file in files:
        key = file.cell, file.ending
        first[key] = min(file.episode, first.get(key, file.episode))
    try:
        for file in files:
            is_first = file.episode == first[file.cell, file.ending]
            if not is_first and (file.stills or file.episode >= KEPT):
                file.path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"a trace cannot be deleted ({error.strerror})", got=str(folder)) from error


class _File(NamedTuple):
    path: Path
    cell: str
    episode: int
    ending: str
    stills: bool


def _files(folder: Path) -> list[_File]:
    """Files of traces in a folder."""
    found = []
    for path in folder.glob("*.npz"):
        if match := _NAME.fullmatch(path.name):
            number, stills = int(match["episode"]), match["stills"] is not None
            found.append(_File(path, match["cell"], number, match["ending"], stills))
    return found


def _ending(line: PlayedLine) -> str:
    return "success" if line.success else "failure"


def _other(ending: str) -> str:
    return "failure" if ending == "success" else "success"
