"""An episode as a small film and as a strip of stills, for people without the rerun viewer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.atomic import replacing
from mpgrasp.recording.false_colour import Picture, shade, shade_depth
from mpgrasp.recording.film_files import FILMS, filmstrip, mp4_encoder, write_animation
from mpgrasp.recording.film_picture import compose, write_caption
from mpgrasp.recording.recorder import TickRecord, claim_file
from mpgrasp.recording.watcher import VIEW, Watcher

if TYPE_CHECKING:
    from mpgrasp.scene.simulation import Simulation

_PERIOD = 0.1  # [s] of simulation between pictures, at first
_MOST = 600  # pictures that are kept; beyond, every other one goes and the period doubles
_LAST = 1.5  # [s] for which the outcome stands still


@dataclass(frozen=True, kw_only=True)
class FilmConfig:
    """Settings of a film."""

    backend: str = "auto"
    """Backend of the watching camera: "gl", "ray" or "auto", as in `WristCamera`."""
    max_bytes: int = 3_000_000
    """A film that gets larger is written again with half of its pictures, at the same speed."""
    strip_pictures: int = 6
    """Pictures on the strip."""

    def __post_init__(self) -> None:
        if self.max_bytes < 1 or self.strip_pictures < 1:
            raise ConfigError("unusable film settings", got=self, allowed="1 or more bytes and pictures")


class FilmRecorder:
    """Films one episode: the scene, depth, Q, entropy and utility, and a line of text below.

    Args:
        paths: files of the film, .gif, .webp or .mp4: one render, as many files as are wanted.
        strip: file of a contact sheet of stills, .png; None for none.
        config: how the film is made.

    Raises:
        OutputError: a file cannot be written, or there is no encoder for it.
        CameraError: backend "gl" without GL.
    """

    def __init__(
        self, *paths: str | Path, strip: str | Path | None = None, config: FilmConfig | None = None
    ) -> None:
        self.paths = [claim_file(path, FILMS) for path in paths]
        if any(path.suffix.lower() == ".mp4" for path in self.paths):
            mp4_encoder()  # none is better known before the episode
        self.strip = None if strip is None else claim_file(strip, (".png",))
        self.config = config or FilmConfig()
        self.pictures: list[Picture] = []
        self.times: list[float] = []
        self._period = _PERIOD
        self._panels: dict[str, Picture] = {}
        self._watcher: Watcher | None = None
        self._caption = ""

    def start(self, simulation: Simulation) -> None:
        self._watcher = Watcher(simulation.model, self.config.backend)

    def tick(self, record: TickRecord) -> None:
        self._look_at_maps(record)
        now = record.simulation.time
        due = not self.times or now - self.times[-1] >= self._period - 1e-6
        if not due and record.event is None:
            return
        self._caption = (
            f"{record.phase:<9} t = {now:5.2f} s    smallest singular value {record.min_singular_value:.3f}"
        )
        self._shoot(record.simulation, record.event or "")

    def finish(self, event: str) -> None:
        """Write the files, each of them that can be.

        Raises:
            OutputError: the disk does not take them.
        """
        if self._watcher is not None:
            self._watcher.close()
        if not self.pictures:
            self.pictures.append(compose(np.zeros((VIEW[1], VIEW[0], 3), np.uint8), {}, "", event))
            self.times.append(0.0)
        # the outcome under the last view of the world
        last = self.pictures[-1].copy()
        write_caption(last, self._caption, event)
        self.pictures.append(last)
        self.times.append(self.times[-1] + _PERIOD)
        files = [partial(self._write_film, path) for path in self.paths]
        if self.strip is not None:
            files.append(partial(self._write_strip, self.strip))
        failed: list[OutputError] = []
        for write in files:  # where there is no room for one, there may be for another
            try:
                write()
            except OutputError as error:
                failed.append(error)
        if failed:
            raise failed[0]

    def _look_at_maps(self, record: TickRecord) -> None:
        if record.frame is not None:
            self._panels["depth"] = shade_depth(record.frame.depth)
        if record.grasp_map is not None:
            self._panels["Q"] = shade(record.grasp_map.quality, 0.0, 1.0)
        for name in ("entropy", "utility"):
            value = record.diagnostics.get(name)
            if isinstance(value, np.ndarray) and value.ndim == 2:
                self._panels[name] = shade(value[::-1])  # rows are world y: a view from above

    def _shoot(self, simulation: Simulation, event: str) -> None:
        assert self._watcher is not None, "tick before start"
        view = self._watcher.picture(simulation.data)
        self.pictures.append(compose(view, self._panels, self._caption, event))
        self.times.append(simulation.time)
        if len(self.pictures) > _MOST:
            self.pictures, self.times = self.pictures[::2], self.times[::2]
            self._period *= 2

    def _write_film(self, path: Path) -> None:
        step = 1
        try:
            with replacing(path) as file:
                while True:
                    # the first and the last picture always stay
                    kept = sorted({0, *range(len(self.pictures) - 1, -1, -step)})
                    times = np.array(self.times)[kept]
                    shown = np.append(np.diff(times), _LAST).clip(0.02)
                    write_animation(file, [self.pictures[k] for k in kept], shown)
                    if file.stat().st_size <= self.config.max_bytes or len(kept) <= 2:
                        break
                    step *= 2
        except OSError as error:
            raise OutputError(f"a film cannot be written: {error}", got=str(path)) from error

    def _write_strip(self, path: Path) -> None:
        chosen = np.linspace(0, len(self.pictures) - 1, self.config.strip_pictures).round().astype(int)
        try:
            with replacing(path) as file:
                filmstrip(file, [self.pictures[k] for k in chosen])
        except OSError as error:
            raise OutputError(f"a strip of stills cannot be written: {error}", got=str(path)) from error
