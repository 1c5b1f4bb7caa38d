"""An episode as a small animation and as a strip of stills, for people without the rerun viewer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.geometry import FloatArray
from mpgrasp.recording.false_colour import shade, shade_depth
from mpgrasp.recording.recorder import TickRecord, claim_file
from mpgrasp.recording.watcher import VIEW, Picture, Watcher

if TYPE_CHECKING:
    from mpgrasp.scene.simulation import Simulation


SIZE = (640, 360)
"""Width and height of a film's pictures [px]."""

_PANEL = (144, 138)  # [px]
_LABEL = 18  # [px], above a panel
_INK, _PAPER = (235, 235, 235), (24, 26, 30)
_PERIOD = 0.1  # [s] of simulation between pictures, at first
_MOST = 600  # pictures that are kept; beyond, every other one goes and the period doubles
_LAST = 1.5  # [s] for which the outcome stands still
_FONT = ImageFont.load_default(13)


@dataclass(frozen=True, kw_only=True)
class FilmConfig:
    """How a film is made."""

    backend: str = "auto"
    """Of the watching camera: "gl", "ray" or "auto", as in `WristCamera`."""
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
        path: where the film goes; .gif or .webp.
        strip: where a contact sheet of stills goes, .png; None for none.
        config: how.

    Raises:
        OutputError: a file cannot be written.
        CameraError: backend "gl" without GL.
    """

    def __init__(
        self, path: str | Path, strip: str | Path | None = None, config: FilmConfig | None = None
    ) -> None:
        self.path = claim_file(path, (".gif", ".webp"))
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
        """Write the files.

        Raises:
            OutputError: the disk does not take them.
        """
        if self._watcher is not None:
            self._watcher.close()
        if not self.pictures:
            self.pictures.append(_compose(np.zeros((VIEW[1], VIEW[0], 3), np.uint8), {}, "", event))
            self.times.append(0.0)
        # the outcome under the last view of the world
        last = self.pictures[-1].copy()
        _write_caption(last, self._caption, event)
        self.pictures.append(last)
        self.times.append(self.times[-1] + _PERIOD)
        try:
            self._write_film()
            if self.strip is not None:
                chosen = (
                    np.linspace(0, len(self.pictures) - 1, self.config.strip_pictures).round().astype(int)
                )
                filmstrip(self.strip, [self.pictures[k] for k in chosen])
        except OSError as error:
            raise OutputError(f"a film cannot be written: {error}", got=str(self.path)) from error

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
        self.pictures.append(_compose(view, self._panels, self._caption, event))
        self.times.append(simulation.time)
        if len(self.pictures) > _MOST:
            self.pictures, self.times = self.pictures[::2], self.times[::2]
            self._period *= 2

    def _write_film(self) -> None:
        step = 1
        while True:
            # the first and the last picture always stay
            kept = sorted({0, *range(len(self.pictures) - 1, -1, -step)})
            times = np.array(self.times)[kept]
            shown = np.append(np.diff(times), _LAST).clip(0.02)
            write_animation(self.path, [self.pictures[k] for k in kept], shown)
            if self.path.stat().st_size <= self.config.max_bytes or len(kept) <= 2:
                return
            step *= 2


def filmstrip(path: str | Path, pictures: list[Picture], columns: int = 3) -> None:
    """Write pictures of one size beside and below each other as one PNG."""
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // columns)
    sheet = np.zeros((rows * height, min(columns, len(pictures)) * width, 3), np.uint8)
    for k, picture in enumerate(pictures):
        top, left = k // columns * height, k % columns * width
        sheet[top : top + height, left : left + width] = picture
    Image.fromarray(sheet).quantize(256).save(path, optimize=True)


def write_animation(path: Path, pictures: list[Picture], durations: FloatArray) -> None:
    """Write pictures as a looping .gif or .webp; durations in seconds."""
    milliseconds = [10 * round(d * 100) for d in durations.tolist()]
    if path.suffix.lower() == ".webp":
        images = [Image.fromarray(p) for p in pictures]
        images[0].save(
            path, save_all=True, append_images=images[1:], duration=milliseconds, loop=0, quality=70, method=2
        )
        return
    # one palette for all, so that what stands still is stored once
    samples = pictures[:: max(1, len(pictures) // 8)]
    palette = Image.fromarray(np.concatenate(samples)).quantize(200, method=Image.Quantize.MEDIANCUT)
    images = [Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=milliseconds,
        loop=0,
        disposal=1,
        optimize=False,
    )


def _compose(view: Picture, panels: dict[str, Picture], caption: str, event: str) -> Picture:
    canvas = np.full((SIZE[1], SIZE[0], 3), _PAPER, np.uint8)
    canvas[: VIEW[1], : VIEW[0]] = view
    for k, name in enumerate(("depth", "Q", "entropy", "utility")):
        left = VIEW[0] + k % 2 * _PANEL[0]
        top = k // 2 * (_PANEL[1] + _LABEL)
        _write(canvas[top : top + _LABEL, left : left + _PANEL[0]], [name])
        if name in panels:
            side = min(_PANEL) - 4
            small = cv2.resize(panels[name], (side, side), interpolation=cv2.INTER_AREA)
            canvas[top + _LABEL : top + _LABEL + side, left + 4 : left + 4 + side] = small
    _write_caption(canvas, caption, event)
    return canvas


def _write_caption(canvas: Picture, caption: str, event: str) -> None:
    strip = canvas[VIEW[1] :]
    strip[:] = _PAPER
    _write(strip, [caption, event])


def _write(area: Picture, lines: list[str]) -> None:
    """Write lines of text into part of a picture, in place."""
    image = Image.fromarray(area)
    draw = ImageDraw.Draw(image)
    for k, line in enumerate(lines):
        draw.text((8, 2 + 21 * k), line, fill=_INK, font=_FONT)
    area[:] = np.asarray(image)
