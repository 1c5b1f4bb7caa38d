"""Pictures of a film written to disk: as GIF, WebP or MP4, and as a sheet of stills.

MP4 is H.264 in yuv420p, which every browser plays, encoded by the ffmpeg that imageio brings.
"""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from PIL import Image

from mpgrasp.exceptions import OutputError
from mpgrasp.geometry import FloatArray
from mpgrasp.recording.false_colour import Picture

FILMS = (".gif", ".webp", ".mp4")
"""Suffixes of films that can be written."""
MP4_RATE = 10
"""Pictures per second of an MP4 [Hz]; one that stands longer is repeated."""


def write_animation(path: Path, pictures: Sequence[Picture], durations: FloatArray) -> None:
    """Write pictures of one size as a film: a .gif or .webp loops, an .mp4 does not.

    Args:
        path: with one of the suffixes `FILMS`.
        pictures: (H, W, 3) each; H and W are even.
        durations: for which each picture stands [s].

    Raises:
        OSError: the disk does not take it, or the encoder fails.
        OutputError: there is no encoder for MP4.
    """
    suffix = path.suffix.lower()
    if suffix == ".mp4":
        _write_mp4(path, pictures, durations)
    elif suffix == ".webp":
        _write_webp(path, pictures, _milliseconds(durations))
    else:
        _write_gif(path, pictures, _milliseconds(durations))


def filmstrip(path: str | Path, pictures: Sequence[Picture], columns: int = 3) -> None:
    """Write pictures of one size beside and below each other as one PNG."""
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // columns)
    sheet = np.zeros((rows * height, min(columns, len(pictures)) * width, 3), np.uint8)
    for k, picture in enumerate(pictures):
        top, left = k // columns * height, k % columns * width
        sheet[top : top + height, left : left + width] = picture
    Image.fromarray(sheet).quantize(256).save(path, optimize=True)


def mp4_encoder() -> str:
    """Return the path of ffmpeg.

    Raises:
        OutputError: there is none.
    """
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise OutputError(
            "there is no ffmpeg to write MP4", allowed="pip install 'imageio[ffmpeg]'"
        ) from error


def _write_mp4(path: Path, pictures: Sequence[Picture], durations: FloatArray) -> None:
    height, width = pictures[0].shape[:2]
    ends = np.rint(np.cumsum(durations) * MP4_RATE).astype(int)
    repeats = np.diff(ends, prepend=0).tolist()
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(MP4_RATE), "-i", "-"]
    # one thread: the other cores play other episodes
    h264 = ["-c:v", "libx264", "-threads", "1", "-preset", "veryfast", "-crf", "23", "-pix_fmt", "yuv420p"]
    command = [mp4_encoder(), "-v", "error", "-y", *raw, *h264, "-movflags", "+faststart", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        assert encoder.stderr is not None
        try:
            for picture, count in zip(pictures, repeats, strict=True):
                for _ in range(count):
                    encoder.stdin.write(picture.tobytes())
            encoder.stdin.close()
        except BrokenPipeError:
            pass  # it says below why it has stopped
        complaint = encoder.stderr.read().decode(errors="replace")
    if encoder.returncode != 0:
        raise OSError(f"ffmpeg: {complaint.strip() or f'ended with exit code {encoder.returncode}'}")


def _milliseconds(durations: FloatArray) -> list[int]:
    return [10 * round(d * 100) for d in durations.tolist()]


def _write_webp(path: Path, pictures: Sequence[Picture], milliseconds: list[int]) -> None:
    first, *rest = [Image.fromarray(p) for p in pictures]
    first.save(path, save_all=True, append_images=rest, duration=milliseconds, loop=0, quality=70, method=2)


def _write_gif(path: Path, pictures: Sequence[Picture], milliseconds: list[int]) -> None:
    # one palette for all, so that what stands still is stored once
    samples = pictures[:: max(1, len(pictures) // 8)]
    palette = Image.fromarray(np.concatenate(samples)).quantize(200, method=Image.Quantize.MEDIANCUT)
    first, *rest = [Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    first.save(
        path,
        save_all=True,
        append_images=rest,
        duration=milliseconds,
        loop=0,
        disposal=1,
        optimize=False,
    )
