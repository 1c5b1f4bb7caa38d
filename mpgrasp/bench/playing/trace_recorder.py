"""Records the trace of an episode while it lasts.

Playing it again for the report would need the same weights, runtime and versions. Stills cost nothing on
the way: postures are remembered, and drawn when the verdict is there, if they are wanted.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpgrasp.bench.record import PlayedLine
from mpgrasp.bench.results.trace import write_trace
from mpgrasp.geometry import FloatArray, look_at

if TYPE_CHECKING:
    from mpgrasp.recording.recorder import TickRecord
    from mpgrasp.scene.simulation import Simulation

STILLS = 6
"""Pictures of an episode, evenly spread over its time."""

_POSTURES = 48  # remembered at most; then every other one is forgotten
_PERIOD = 0.25  # [s] between remembered postures, at first
_SAMPLES = 4000  # of the way, likewise
_QUALITY = 72  # of a still's WebP picture
_INSET = 96  # [px], side of the quality map in a still's corner
_VIEWPOINT = look_at([1.25, -0.75, 0.75], [0.46, 0.0, 0.22], x_axis=(0.75, 0.79, 0.0))  # of stills


class TraceRecorder:
    """Records one episode; `save` writes what is wanted of it.

    Args:
        folder: of the traces; made if need be.
        camera: backend that draws the stills: "gl", "ray" or "auto".
    """

    def __init__(self, folder: Path, camera: str = "auto") -> None:
        self.folder, self.camera = folder, camera
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

    def save(self, line: PlayedLine) -> None:
        """Write the way and the stills, each if it is wanted.

        Args:
            line: of the episode.

        Raises:
            OutputError: a file cannot be written.
        """
        if self._simulation is not None and self._samples:
            write_trace(self.folder, line, self._way, self._pictures)

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


@dataclass(eq=False)
class _Posture:
    time: float
    phase: str
    qpos: FloatArray
    quality: NDArray[np.float16] | None


def _draw(simulation: Simulation, postures: Iterable[_Posture], camera: str) -> list[bytes]:
    import mujoco
    from PIL import Image

    from mpgrasp.recording.false_colour import shade
    from mpgrasp.recording.watcher import Watcher
    from mpgrasp.scene.watch import forward

    data = mujoco.MjData(simulation.model)
    watcher = Watcher(simulation.model, camera)
    pictures = []
    try:
        for posture in postures:
            data.qpos[:] = posture.qpos
            forward(simulation.model, data)
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
