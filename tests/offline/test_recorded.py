"""A recording of a camera is read as it was taken, and what cannot be used is named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down
from mpgrasp.offline.recorded import CAMERA, COLUMNS, POSES, Recording

MOUNT = [[0.0, -1.0, 0.0, 0.07], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -0.06], [0.0, 0.0, 0.0, 1.0]]
LENS: dict[str, Any] = {
    "fx": 460.0,
    "fy": 461.0,
    "cx": 30.0,
    "cy": 20.0,
    "unit": 0.001,
    "no_return": [0],
    "T_tcp_camera": MOUNT,
}
DOWN = "0.5,0.1,0.4,0.0,0.70710678,-0.70710678,0.0"
"""The tool point looks down, its x axis along the world's -y."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    image = np.full((40, 60), 460, np.uint16)
    image[3, 4] = 0
    cv2.imwrite(str(tmp_path / "a.png"), image)
    np.save(tmp_path / "b.npy", image)
    (tmp_path / CAMERA).write_text(json.dumps(LENS))
    write(tmp_path, f"a.png,1.5,{DOWN}", f"b.npy,1.6,{DOWN}")
    return tmp_path


def write(folder: Path, *rows: str, columns: str = ",".join(COLUMNS)) -> None:
    (folder / POSES).write_text("\n".join([columns, *rows]) + "\n")


def test_views_are_metres_seen_from_where_the_calibration_puts_the_camera(folder: Path) -> None:
    recording = Recording(folder)
    first, second = recording
    assert len(recording) == 2
    assert (first.name, second.name, first.frame.time) == ("a.png", "b.npy", 1.5)
    np.testing.assert_array_equal(first.frame.depth, second.frame.depth)
    assert np.isnan(first.frame.depth[3, 4])
    assert np.nanmax(first.frame.depth) == np.float32(0.46)
    np.testing.assert_allclose(first.T_world_tcp, looking_down([0.5, 0.1, 0.4], -np.pi / 2), atol=1e-7)
    # the camera's optical axis is the tool's, and its centre 70 mm along the tool's x and 60 mm behind it
    camera = first.frame.T_world_camera
    np.testing.assert_allclose(camera[:3, 3], [0.5, 0.1 - 0.07, 0.46], atol=1e-7)
    np.testing.assert_allclose(camera[:3, 2], [0, 0, -1], atol=1e-7)
    assert first.frame.intrinsics.fy == 461.0


def test_an_image_is_read_when_its_turn_comes(folder: Path) -> None:
    (folder / "b.npy").write_bytes(b"torn")
    views = iter(Recording(folder))
    assert next(views).name == "a.png"
    with pytest.raises(ConfigError, match=r"cannot be read .*b\.npy"):
        next(views)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"unit": "mm"}, "unit is no number; got 'mm'"),
        ({"unit": 1}, "unusable unit"),
        ({"fx": 0}, "fx"),
        ({"T_tcp_camera": [[1, 0], [0, 1]]}, "T_tcp_camera"),
        ({"T_tcp_camera": "none"}, "T_tcp_camera"),
        ({"focal": 3}, "focal"),
        ({"cx": None}, "cx is no number"),
    ],
    ids=str,
)
def test_a_camera_that_cannot_be_used_is_refused(folder: Path, change: dict[str, Any], said: str) -> None:
    (folder / CAMERA).write_text(json.dumps(LENS | change))
    with pytest.raises(ConfigError, match=said):
        list(Recording(folder))


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([], "without a view"),
        ([f"none.png,0,{DOWN}"], "cannot be read"),
        ([f"{CAMERA},0,{DOWN}"], "that is none"),
        ([f"a.png,now,{DOWN}"], "line 2: time is no finite number; got 'now'"),
        (["a.png,0,0.5,0.1,0.4,1,1,0,0"], "line 2: no unit quaternion"),
        (["a.png,0,0.5"], "line 2: y is no finite number"),
    ],
    ids=str,
)
def test_rows_that_cannot_be_used_are_refused(folder: Path, rows: list[str], said: str) -> None:
    write(folder, *rows)
    with pytest.raises(ConfigError, match=said):
        list(Recording(folder))


def test_files_that_are_missing_are_named(folder: Path) -> None:
    write(folder, f"a.png,0,{DOWN}", columns="file,t,x,y,z,qw,qx,qy,qz")
    with pytest.raises(ConfigError, match="other columns"):
        Recording(folder)
    (folder / POSES).unlink()
    with pytest.raises(ConfigError, match=r"No such file.*poses\.csv"):
        Recording(folder)
    (folder / CAMERA).write_text("{}")
    with pytest.raises(ConfigError, match="lacks fx"):
        Recording(folder)
    (folder / CAMERA).write_text("[1]")
    with pytest.raises(ConfigError, match="no table"):
        Recording(folder)
    (folder / CAMERA).write_text("{")
    with pytest.raises(ConfigError, match="no JSON"):
        Recording(folder)
