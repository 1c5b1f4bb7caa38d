"""Laws of recordings for the rerun viewer."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from full_disk import room_for
from toy_recordings import GRASP, play, toy_simulation

from mpgrasp.exceptions import OutputError
from mpgrasp.geometry import transform
from mpgrasp.recording.recorder import NullRecorder, TeeRecorder
from mpgrasp.recording.rerun import RerunRecorder, grasp_lines
from mpgrasp.recording.rerun_model import RerunModel


@pytest.fixture
def simulation() -> Any:
    return toy_simulation()


def _chunks(path: Path) -> list[Any]:
    from rerun.chunk import RrdReader

    return list(RrdReader(path).stream())


def _text(chunks: list[Any], entity_path: str) -> str:
    """Names and values of an entity's columns, clock times left out."""
    words = []
    for chunk in chunks:
        if chunk.entity_path == entity_path:
            batch = chunk.to_record_batch()
            for name, column in zip(batch.schema.names, batch.columns, strict=True):
                words.append(name if name.startswith("log_") else f"{name} {column.to_pylist()}")
    return " ".join(words)


def test_a_recording_loads_back_with_everything_in_it(simulation: Any, tmp_path: Path) -> None:
    path = tmp_path / "new" / "episode.rrd"
    play(RerunRecorder(path), simulation)
    assert 10_000 < path.stat().st_size < 2_000_000
    chunks = _chunks(path)
    paths = {chunk.entity_path for chunk in chunks}
    expected = {
        "/world/scene/world/table",
        "/world/scene/world/cloth",
        "/world/scene/stick",
        "/world/camera",
        "/world/camera/depth",
        "/world/grasp",
        "/maps/quality",
        "/maps/angle",
        "/maps/width",
        "/grid/entropy",
        "/grid/utility",
        "/controller/peak",
        "/controller/cost",
        "/twist/linear/commanded",
        "/twist/angular/achieved",
        "/arm/min_singular_value",
        "/arm/manipulability",
        "/arm/tcp_height",
        "/arm/gripper_width",
        "/events",
    }
    assert expected <= paths
    words = _text(chunks, "/events")
    for word in ("phase: reach", "phase: lift", "joint 3 too fast", "success"):
        assert word in words
    assert "sim_time" in words
    assert "0.15" in _text(chunks, "/arm/min_singular_value")


def test_a_drawn_grasp_is_as_wide_as_the_grasp_and_ends_at_its_point() -> None:
    fork, stem = grasp_lines(GRASP)
    tips = fork[[0, 3]]
    np.testing.assert_allclose(tips.mean(axis=0), GRASP.position, atol=1e-12)
    assert np.linalg.norm(tips[1] - tips[0]) == pytest.approx(0.05)
    closing = (tips[1] - tips[0]) / 0.05
    np.testing.assert_allclose(closing, [np.cos(0.4), np.sin(0.4), 0], atol=1e-12)
    assert stem[1, 2] > GRASP.position[2]


def test_height_field_meshes_lie_where_rays_meet_the_field(simulation: Any) -> None:
    log: dict[str, Any] = {}
    stream: Any = SimpleNamespace(log=lambda path, *what, static=False: log.update({path: what}))
    scene = RerunModel(stream, simulation.model, "world")
    geom = simulation.model.geom("cloth").id
    points, faces = scene._height_field(geom)
    start, hit = np.array([0.0, 0.0, 1.0]), np.zeros(1, np.int32)
    groups = np.ones(6, np.uint8)
    data = mujoco.MjData(simulation.model)
    data.qpos[2] = 5  # out of the way
    mujoco.mj_forward(simulation.model, data)
    for k in (40, 57, 100):
        start[:2] = points[k, :2] + [0.5, 0.0] + np.array([1e-6, 2e-6])
        distance = mujoco.mj_ray(simulation.model, data, start, np.array([0, 0, -1.0]), groups, True, -1, hit)
        assert 1 - distance == pytest.approx(points[k, 2], abs=1e-4)
    assert faces.max() == len(points) - 1
    a, b, c = np.moveaxis(points[faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_poses_are_logged_only_when_they_change(simulation: Any) -> None:
    log: list[str] = []
    stream: Any = SimpleNamespace(log=lambda path, *what, static=False: None if static else log.append(path))
    scene = RerunModel(stream, simulation.model, "world")
    scene.log_poses(simulation.data)
    assert sorted(log) == ["world/stick", "world/world"]
    simulation.data.qpos[0] += 0.01
    mujoco.mj_forward(simulation.model, simulation.data)
    scene.log_poses(simulation.data)
    assert log[2:] == ["world/stick"]


def test_transform_of_grasp_is_a_rotation() -> None:
    T = GRASP.T_world_grasp()
    np.testing.assert_allclose(T, transform(T[:3, :3], GRASP.position))


def test_on_a_full_disk_a_recording_is_one_error_at_once_and_leaves_nothing(
    simulation: Any, tmp_path: Path
) -> None:
    path = tmp_path / "episode.rrd"
    start = time.monotonic()
    with (
        room_for(100_000),
        pytest.raises(OutputError, match=r"recording cannot be written: .*episode\.rrd"),
    ):
        play(RerunRecorder(path), simulation)
    assert time.monotonic() - start < 20  # rerun itself would wait for hours
    assert list(tmp_path.iterdir()) == []
    path.write_text("an earlier one")
    with room_for(100_000), pytest.raises(OutputError):
        play(RerunRecorder(path), simulation)
    assert path.read_text() == "an earlier one"


def test_a_recording_has_its_name_only_once_it_is_whole(simulation: Any, tmp_path: Path) -> None:
    recorder, seen = RerunRecorder(tmp_path / "episode.rrd"), []

    class Looking(NullRecorder):
        def tick(self, record: Any) -> None:
            seen.append(list(tmp_path.iterdir()))

    play(TeeRecorder(recorder, Looking()), simulation)
    assert not any(seen)
    assert [file.name for file in tmp_path.iterdir()] == ["episode.rrd"]


def test_a_recording_brings_its_layout_along(simulation: Any, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    play(RerunRecorder(tmp_path / "episode.rrd"), simulation)
    reader = RrdReader(tmp_path / "episode.rrd")
    assert [entry.application_id for entry in reader.recordings()] == ["mpgrasp"]
    assert [entry.application_id for entry in reader.blueprints()] == ["mpgrasp"]
