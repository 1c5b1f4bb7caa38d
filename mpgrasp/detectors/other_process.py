"""A detector in a process, and an environment, of its own: images go to its standard input, maps come back.

Each message is a line of JSON, which ends with a line end, and behind it the numbers that it announces,
little endian and row by row. To the detector:

    {"kind": "reset"}
    {"kind": "predict", "height": H, "width": W, "colour": false, "fx": .., "fy": .., "cx": .., "cy": ..,
     "T_world_camera": [16 numbers], "time": ..}
    then H x W float32, depth [m] with its holes filled; with colour H x W x 3 uint8 behind it

From the detector:

    {"kind": "ready", "name": "mine", "colour": false}      once, when it has started
    {"kind": "maps", "height": H, "width": W}               the answer to predict; nothing answers a reset
    then quality in [0, 1], angle [rad, counter-clockwise on screen] and width [px], each H x W float32
    {"kind": "error", "said": "..."}                        in the place of any answer

The program may print what it likes to its standard error. It ends when its standard input ends.
"""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import time
import weakref
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import CROP, NETWORK_SIZE, DepthFrame, inpaint
from mpgrasp.detectors.central_square import central_square, empty_map, says_something
from mpgrasp.exceptions import ConfigError, PlugInError
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap

START_LIMIT, ANSWER_LIMIT = 120.0, 20.0
"""Time that a program may take to get ready, and to answer [s]."""
LONGEST_LINE = 1 << 16
"""Longest line of JSON [bytes]."""
_PIECE = 1 << 16  # bytes that are moved at a time


class OtherProcess:
    """Detector whose maps another program makes.

    The program is started at once, in the folder of this process, and ended when the detector is no longer
    used.

    Args:
        command: program and arguments, such as `["/other/venv/bin/python", "serve_my_net.py"]`.
        crop: side of the central square of a frame that it is shown [px].
        size: side of the image that it gets [px].
        start_limit: time that it may take to get ready [s].
        answer_limit: time that an answer may take [s].

    Raises:
        ConfigError: a program that cannot be started, ends, or does not get ready in time.
    """

    reads_truth = False

    def __init__(
        self,
        command: Sequence[str],
        *,
        crop: int = CROP,
        size: int = NETWORK_SIZE,
        start_limit: float = START_LIMIT,
        answer_limit: float = ANSWER_LIMIT,
    ) -> None:
        if isinstance(command, str) or not command:
            raise ConfigError("unusable command", got=command, allowed='["python", "serve_my_net.py"]')
        self.config = {"command": [Path(command[0]).name, *command[1:]], "crop": crop, "size": size}
        self._crop, self._size, self._limit = crop, size, answer_limit
        try:
            self._process = subprocess.Popen(
                list(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
            )
        except OSError as error:
            raise ConfigError(
                f"a detector's program cannot be started ({error.strerror})", got=command[0]
            ) from error
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)  # a program that does not read must not stop us
        self._end = weakref.finalize(self, _end, self._process)
        try:
            told = self._message("ready", time.monotonic() + start_limit)
            self.name, self.reads_colour = str(told["name"]), bool(told.get("colour", False))
        except (PlugInError, KeyError) as error:
            self.close()
            raise ConfigError(
                f"a detector's program did not get ready ({error})",
                got=" ".join(command),
                allowed='a line {"kind": "ready", "name": ...}',
            ) from error

    def reset(self, truth: HeightMap | None) -> None:
        self._send({"kind": "reset"}, b"", time.monotonic() + self._limit)

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Return what the program makes of the frame's central square.

        Raises:
            PlugInError: it ended, took too long, or answered with something else.
        """
        image = central_square(frame, self._crop, self._size)
        measured, depth = np.isfinite(image.depth), inpaint(image.depth)
        nothing = replace(empty_map(replace(image, depth=depth)), measured=measured)
        if not says_something(frame, image):
            return nothing
        k = image.intrinsics
        height, width = depth.shape
        colour = self.reads_colour and image.rgb is not None
        header = {
            "kind": "predict", "height": height, "width": width, "colour": colour, "fx": k.fx, "fy": k.fy,
            "cx": k.cx, "cy": k.cy, "T_world_camera": image.T_world_camera.ravel().tolist(),
            "time": image.time,
        }  # fmt: skip
        numbers = np.ascontiguousarray(depth, "<f4").tobytes()
        if colour:
            assert image.rgb is not None
            numbers += np.ascontiguousarray(image.rgb, np.uint8).tobytes()
        deadline = time.monotonic() + self._limit
        self._send(header, numbers, deadline)
        told = self._message("maps", deadline)
        if (told.get("height"), told.get("width")) != (height, width):
            raise self._broken(f"maps of {told.get('height')} x {told.get('width')} for {height} x {width}")
        maps = [self._array(height, width, deadline) for _ in range(3)]
        return replace(nothing, quality=maps[0], angle=maps[1], width=maps[2])

    def close(self) -> None:
        """End the program."""
        self._end()

    def _send(self, header: dict[str, Any], numbers: bytes, deadline: float) -> None:
        """Write a message, or raise PlugInError where it is not taken in time."""
        assert self._process.stdin is not None
        left = memoryview(json.dumps(header).encode() + b"\n" + numbers)
        try:
            with selectors.DefaultSelector() as selector:
                selector.register(self._process.stdin, selectors.EVENT_WRITE)
                while left:
                    if not selector.select(max(deadline - time.monotonic(), 0.0)):
                        raise self._broken("no answer in time")
                    left = left[os.write(self._process.stdin.fileno(), left[:_PIECE]) :]
        except (OSError, ValueError) as error:
            raise self._broken("it has ended") from error

    def _message(self, kind: str, deadline: float) -> dict[str, Any]:
        """Return the next message, which must be of that kind."""
        line = b""
        while not line.endswith(b"\n"):
            if len(line) > LONGEST_LINE:
                raise self._broken(f"no line of JSON: {line[:40]!r}")
            line += self._read(1, deadline)
        try:
            told = json.loads(line)
        except ValueError as error:
            raise self._broken(f"no line of JSON: {line[:40]!r}") from error
        if not isinstance(told, dict) or told.get("kind") != kind:
            said = told.get("said", told) if isinstance(told, dict) else told
            raise self._broken(f"said {str(said)[:200]!r} in the place of {kind!r}")
        return told

    def _array(self, height: int, width: int, deadline: float) -> NDArray[np.float32]:
        content = self._read(4 * height * width, deadline)
        return np.frombuffer(content, "<f4").reshape(height, width).astype(np.float32)

    def _read(self, count: int, deadline: float) -> bytes:
        """Return so many bytes, or raise PlugInError where they do not come in time."""
        assert self._process.stdout is not None
        pipe, pieces, missing = self._process.stdout.fileno(), [], count
        with selectors.DefaultSelector() as selector:
            selector.register(pipe, selectors.EVENT_READ)
            while missing:
                if not selector.select(max(deadline - time.monotonic(), 0.0)):
                    raise self._broken("no answer in time")
                piece = os.read(pipe, min(missing, _PIECE))
                if not piece:
                    with suppress(
                        subprocess.TimeoutExpired
                    ):  # it has let go of the pipe, and is about to end
                        self._process.wait(1.0)
                    raise self._broken(f"it has ended with code {self._process.poll()}")
                pieces.append(piece)
                missing -= len(piece)
        return b"".join(pieces)

    def _broken(self, what: str) -> PlugInError:
        """End the program, whose answers are out of step from now on, and return the error about it."""
        self.close()
        return PlugInError(f"a detector's program: {what}")


def _end(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()
    try:
        process.wait(0.5)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
