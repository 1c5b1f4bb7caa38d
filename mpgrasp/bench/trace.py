"""What a run keeps of an episode for its report: way, singular values, entropy map, and a few stills.

Ways are kept of the first `KEPT` episodes of each cell, about 2 kB each; stills and the entropy map of its
first success and its first failure, about 45 kB. They are recorded while the episode
lasts, since playing it again for the report would need the same weights, runtime and versions. Stills
cost nothing on the way: postures are remembered, and drawn when the verdict is there, if they are wanted.
"""

from __future__ import annotations

import glob
import io
import os
import re
import zipfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import OutputError
from mpgrasp.geometry import FloatArray, look_at

if TYPE_CHECKING:
    from mpgrasp.recording import TickRecord
    from mpgrasp.simulation import Simulation

KEPT = 10
"""Episodes of each cell, the first ones, whose traces stay beside those with stills."""
STILLS = 6
"""Pictures of an episode, evenly spread over its time."""

_POSTURES = 48  # remembered at most; then every other one is forgotten
_PERIOD = 0.25  # [s] between remembered postures, at first
_SAMPLES = 4000  # of the way, likewise
_QUALITY = 72  # of a still's WebP picture
_INSET = 96  # [px], side of the quality map in a still's corner
_STILLS = "-stills"  # in the name of a file with pictures
_NAME = re.compile(rf"(?P<cell>.+)-(?P<episode>\d+)-(?P<verdict>success|failure)(?P<stills>{_STILLS})?\.npz")
_VIEWPOINT = look_at([1.25, -0.75, 0.75], [0.46, 0.0, 0.22], x_axis=(0.75, 0.79, 0.0))  # of stills


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """What was kept of one episode."""

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


@dataclass(eq=False)
class _Posture:
    time: float
    phase: str
    qpos: FloatArray
    quality: NDArray[np.float16] | None


class TraceRecorder:
    """Records one episode; `save` writes what is wanted of it.

    Args:
        folder: of the traces; made if need be.
        stem: of the file, cell and number of the episode, as in `Task.stem`.
        camera: backend that draws the stills: "gl", "ray" or "auto".
    """

    def __init__(self, folder: Path, stem: str, camera: str = "auto") -> None:
        self.folder, self.stem, self.camera = folder, stem, camera
        self._simulation: Simulation | None = None
        self._start = 0.0
        self._samples: list[tuple[float, float, float, float, float]] = []
        self._postures: list[_Posture] = []
        self._period, self._step, self._ticks = _PERIOD, 1, 0
        self._entropy: FloatArray | None = None
        self._phase = "start"

    def start(self, simulation: Simulation) -> None:
        if self._simulation is None:
            self._start = simulation.time
        self._simulation = simulation

    def tick(self, record: TickRecord) -> None:
        now = record.simulation.time - self._start
        self._phase = record.phase
        if self._ticks % self._step == 0:
            x, y, z = record.simulation.T_world_tcp[:3, 3].tolist()
            self._samples.append((now, x, y, z, float(record.min_singular_value)))
            if len(self._samples) > _SAMPLES:
                self._samples, self._step = self._samples[::2], 2 * self._step
        self._ticks += 1
        entropy = record.diagnostics.get("entropy")
        if isinstance(entropy, np.ndarray) and entropy.ndim == 2:
            self._entropy = entropy
        if not self._postures or now - self._postures[-1].time >= self._period - 1e-6:
            quality = None if record.grasp_map is None else record.grasp_map.quality.astype(np.float16)
            self._remember(now, quality)

    def finish(self, event: str) -> None:
        pass

    def save(self, record: Mapping[str, Any]) -> None:
        """Write the way and the stills, each if it is wanted.

        Args:
            record: `EpisodeResult.as_record()`; its `success` and `state_hash` count.

        Raises:
            OutputError: a file cannot be written.
        """
        if self._simulation is None or not self._samples:
            return
        cell, _, number = self.stem.rpartition("-")
        verdict, episode = _verdict(record), int(number)
        hashed = {"state_hash": np.array(str(record.get("state_hash")))}
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for file in self.folder.glob(f"{glob.escape(self.stem)}-{_other(verdict)}*.npz"):
                file.unlink(missing_ok=True)  # of an earlier run that ended otherwise
            before = (f.episode for f in _files(self.folder) if (f.cell, f.verdict) == (cell, verdict))
            first = min(before, default=episode) >= episode
            if first or episode < KEPT:
                self._write(f"{self.stem}-{verdict}.npz", {**hashed, **self._way()})
            if first:
                self._write(f"{self.stem}-{verdict}{_STILLS}.npz", {**hashed, **self._pictures()})
        except OSError as error:
            raise OutputError(
                f"a trace cannot be written ({error.strerror or error})",
                got=str(self.folder),
                allowed="a directory one may write to",
            ) from error

    def _remember(self, now: float, quality: NDArray[np.float16] | None) -> None:
        assert self._simulation is not None
        qpos = self._simulation.data.qpos.copy()
        self._postures.append(_Posture(now, self._phase, qpos, quality))
        if len(self._postures) > _POSTURES:
            self._postures, self._period = self._postures[::2], 2 * self._period

    def _way(self) -> dict[str, Any]:
        samples = np.array(self._samples, np.float32)
        return {"times": samples[:, 0], "positions": samples[:, 1:4], "singular_values": samples[:, 4]}

    def _pictures(self) -> dict[str, Any]:
        assert self._simulation is not None
        end = self._simulation.time - self._start
        if end > self._postures[-1].time:
            self._remember(end, None)
        chosen = np.linspace(0, len(self._postures) - 1, min(STILLS, len(self._postures)))
        postures = [self._postures[k] for k in chosen.round().astype(int)]
        content: dict[str, Any] = {
            "still_times": np.array([posture.time for posture in postures], np.float32),
            "still_phases": np.array([posture.phase for posture in postures]),
        }
        if self._entropy is not None:
            content["entropy"] = self._entropy.astype(np.float16)
        for k, picture in enumerate(_draw(self._simulation, postures, self.camera)):
            content[f"still_{k}"] = np.frombuffer(picture, np.uint8)
        return content

    def _write(self, name: str, content: Mapping[str, Any]) -> None:
        temporary = self.folder / f".{name}.tmp"
        try:
            with temporary.open("wb") as file:
                np.savez_compressed(file, **content)
            os.replace(temporary, self.folder / name)
        except OSError:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise


def _draw(simulation: Simulation, postures: Iterable[_Posture], camera: str) -> list[bytes]:
    import mujoco
    from PIL import Image

    from mpgrasp.false_colour import shade
    from mpgrasp.film import Watcher

    data = mujoco.MjData(simulation.model)
    watcher = Watcher(simulation.model, camera)
    pictures = []
    try:
        for posture in postures:
            data.qpos[:] = posture.qpos
            mujoco.mj_forward(simulation.model, data)
            image = Image.fromarray(watcher.picture(data, _VIEWPOINT))
            if posture.quality is not None:
                inset = Image.fromarray(shade(posture.quality.astype(float), 0.0, 1.0))
                image.paste(inset.resize((_INSET, _INSET)), (image.width - _INSET, 0))
            file = io.BytesIO()
            image.save(file, "WEBP", quality=_QUALITY)
            pictures.append(file.getvalue())
    finally:
        watcher.close()
    return pictures


def read_trace(folder: Path, stem: str, line: Mapping[str, Any]) -> Trace | None:
    """The trace of the episode that a line of episodes.jsonl tells of; None if none was kept.

    Args:
        folder: of the traces.
        stem: as in `Task.stem`.
        line: its `success` and `state_hash` must be the trace's.

    Raises:
        OutputError: a file that is no trace.
    """
    name = f"{stem}-{_verdict(line)}"
    way, seen = (_read(folder / f"{name}{kind}.npz", str(line.get("state_hash"))) for kind in ("", _STILLS))
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


def _read(file: Path, state_hash: str) -> dict[str, Any] | None:
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
        key = file.cell, file.verdict
        first[key] = min(file.episode, first.get(key, file.episode))
    try:
        for file in files:
            is_first = file.episode == first[file.cell, file.verdict]
            if not is_first and (file.stills or file.episode >= KEPT):
                file.path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"a trace cannot be deleted ({error.strerror})", got=str(folder)) from error


class _File(NamedTuple):
    path: Path
    cell: str
    episode: int
    verdict: str
    stills: bool


def _files(folder: Path) -> list[_File]:
    """What a folder holds of traces."""
    found = []
    for path in folder.glob("*.npz"):
        if match := _NAME.fullmatch(path.name):
            number, stills = int(match["episode"]), match["stills"] is not None
            found.append(_File(path, match["cell"], number, match["verdict"], stills))
    return found


def _verdict(record: Mapping[str, Any]) -> str:
    return "success" if record.get("success") else "failure"


def _other(verdict: str) -> str:
    return "failure" if verdict == "success" else "success"
