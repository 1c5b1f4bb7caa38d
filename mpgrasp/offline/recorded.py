"""A recording of a robot's depth camera on disk: images, the poses that they were taken from, the camera.

    my_recording/
      camera.json    {"fx": 460.0, "fy": 460.0, "cx": 423.5, "cy": 239.5, "unit": 0.001, "no_return": [0],
                      "T_tcp_camera": [[0, -1, 0, 0.07], [1, 0, 0, 0], [0, 0, 1, -0.063], [0, 0, 0, 1]]}
      poses.csv      file,time,x,y,z,qw,qx,qy,qz
                     0000.png,0.0,0.57,0.0,0.56,0.0,0.7071,-0.7071,0.0
      0000.png       a depth image: PNG or TIFF as cameras store it, or .npy

A row is the pose of the tool point in the world: position [m] and unit quaternion. `T_tcp_camera` is the
camera's OpenCV frame in the tool's, as a hand-eye calibration gives it.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.regular import read_regular
from mpgrasp.files.settings import refuse_unknown
from mpgrasp.geometry import FloatArray, check_pose, rotation_from_quaternion, transform
from mpgrasp.linear_algebra import norm, product

CAMERA, POSES = "camera.json", "poses.csv"
COLUMNS = ("file", "time", "x", "y", "z", "qw", "qx", "qy", "qz")
_KEYS = ("fx", "fy", "cx", "cy", "unit", "no_return", "T_tcp_camera")
_LARGEST = 200.0  # [MB] of a file
_UNIT_LENGTH = 0.01  # a quaternion may be off its length by


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedView:
    """One image of a recording."""

    name: str
    """File of the image."""
    frame: DepthFrame
    T_world_tcp: FloatArray
    """(4, 4) pose of the tool point."""


class Recording:
    """The views of a folder in the order of their rows; images are read one at a time.

    Raises:
        ConfigError: a file that is missing or cannot be used; of an image, when its turn comes.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._camera = _camera(folder / CAMERA)
        self._rows = _rows(folder / POSES)

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[RecordedView]:
        return (self._view(k, row) for k, row in enumerate(self._rows, 2))

    def _view(self, line: int, row: Mapping[str, str]) -> RecordedView:
        where = f"{self._folder / POSES}, line {line}"
        time, *pose = (_number(row, key, where) for key in COLUMNS[1:])
        position, quaternion = np.array(pose[:3]), np.array(pose[3:])
        if abs(norm(quaternion) - 1) > _UNIT_LENGTH:
            raise ConfigError(f"{where}: no unit quaternion", got=pose[3:], allowed="qw, qx, qy, qz")
        T = transform(rotation_from_quaternion(quaternion / norm(quaternion)), position)
        image, camera = _image(self._folder / row["file"]), self._camera
        intrinsics = CameraIntrinsics(
            width=image.shape[1], height=image.shape[0], **{k: camera[k] for k in ("fx", "fy", "cx", "cy")}
        )
        frame = DepthFrame.from_camera(
            image,
            intrinsics=intrinsics,
            T_world_camera=product(T, camera["T_tcp_camera"]),
            unit=camera["unit"],
            no_return=camera["no_return"],
            time=time,
        )
        return RecordedView(name=row["file"], frame=frame, T_world_tcp=T)


def _text(path: Path) -> str:
    try:
        return read_regular(path, _LARGEST).decode()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(
            f"a file of a recording cannot be read ({reason})", got=str(path), allowed=f"{CAMERA} and {POSES}"
        ) from error


def _camera(path: Path) -> dict[str, Any]:
    try:
        camera = json.loads(_text(path))
    except ValueError as error:
        raise ConfigError(f"a camera that is no JSON ({error})", got=str(path)) from error
    if not isinstance(camera, dict):
        raise ConfigError("a camera that is no table", got=str(path), allowed=_KEYS)
    refuse_unknown(camera, _KEYS, str(path))
    missing = [key for key in _KEYS if key not in camera]
    if missing:
        raise ConfigError(f"{path} lacks {', '.join(missing)}", allowed=_KEYS)
    for key in ("fx", "fy", "cx", "cy", "unit"):
        if isinstance(camera[key], bool) or not isinstance(camera[key], int | float):
            raise ConfigError(f"{path}: {key} is no number", got=camera[key])
    try:
        pose = np.array(camera["T_tcp_camera"], float)
    except (TypeError, ValueError):
        pose = np.zeros(0)
    check_pose(pose, f"{path}: T_tcp_camera")
    return {**camera, "T_tcp_camera": pose}


def _rows(path: Path) -> list[dict[str, str]]:
    reader = csv.DictReader(io.StringIO(_text(path)))
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise ConfigError(f"{path}: other columns", got=reader.fieldnames, allowed=",".join(COLUMNS))
    rows = list(reader)
    if not rows:
        raise ConfigError("a recording without a view", got=str(path), allowed="one row or more")
    return rows


def _number(row: Mapping[str, str | None], key: str, where: str) -> float:
    try:
        number = float(row[key] or "")
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise ConfigError(f"{where}: {key} is no finite number", got=row[key])
    return number


def _image(path: Path) -> NDArray[np.generic]:
    try:
        content = read_regular(path, _LARGEST)
        if path.suffix == ".npy":
            return np.asarray(np.load(io.BytesIO(content), allow_pickle=False))
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"an image of a recording cannot be read ({reason})", got=str(path)) from error
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED) if content else None
    if image is None:
        raise ConfigError("an image of a recording that is none", got=str(path), allowed="PNG, TIFF, .npy")
    return np.asarray(image)
