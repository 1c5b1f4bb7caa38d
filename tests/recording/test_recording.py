from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from mpgrasp.recording.watcher import Watcher
from PIL import Image

from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import crop_resize, inpaint
from mpgrasp.exceptions import OutputError
from mpgrasp.geometry import looking_down, transform
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.recording.false_colour import HOLE, shade, shade_depth, shade_lines
from mpgrasp.recording.film import SIZE, FilmConfig, FilmRecorder, filmstrip
from mpgrasp.recording.recorder import NullRecorder, Recorder, TeeRecorder, TickRecord, claim_file
from mpgrasp.recording.rerun import RerunRecorder, grasp_lines
from mpgrasp.recording.rerun_model import RerunModel

XML = """
<mujoco>
  <asset>
    <hfield name="cloth" nrow="21" ncol="31" size=".3 .2 .01 .05"/>
    <mesh name="wedge" vertex="0 0 0 .05 0 0 0 .05 0 0 0 .06 .05 .05 .03"/>
    <material name="red" rgba="0.8 0.1 0.1 1"/>
  </asset>
  <worldbody>
    <light pos="0 0 2"/>
    <geom type="plane" size="2 2 .1" pos="0 0 -.1"/>
    <geom name="table" type="box" size=".5 .5 .02" pos="0.5 0 -.021" rgba=".5 .4 .3 1"/>
    <geom name="cloth" type="hfield" hfield="cloth" pos="0.5 0 0" rgba=".6 .6 .6 1"/>
    <body name="stick" pos="0.5 0 .03"><freejoint/>
      <geom type="box" size=".03 .01 .004" material="red"/>
      <geom type="capsule" size=".005 .02"/><geom type="cylinder" size=".005 .02"/>
      <geom type="sphere" size=".01"/><geom type="ellipsoid" size=".01 .02 .01"/>
      <geom type="mesh" mesh="wedge"/>
    </body>
    <camera name="panda/wrist" pos="0.5 0 0.5" fovy="60"/>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def simulation() -> Any:
    model = mujoco.MjModel.from_xml_string(XML)
    model.hfield_data[:] = np.random.default_rng(0).random(model.nhfielddata)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return SimpleNamespace(
        model=model, data=data, time=0.0, T_world_tcp=looking_down([0.5, 0.0, 0.4]), gripper_width=0.08
    )


GRASP = Grasp(position=np.array([0.5, 0.02, 0.03]), angle=0.4, width=0.05, quality=0.8)


def _play(recorder: Recorder, simulation: Any, ticks: int = 6) -> None:
    camera = WristCamera(simulation.model, "ray", crop=350)
    rng = np.random.default_rng(0)
    recorder.start(simulation)
    for k in range(ticks):
        simulation.time = simulation.data.time = 0.1 * k
        simulation.data.qpos[2] = 0.03 + 0.01 * k
        mujoco.mj_forward(simulation.model, simulation.data)
        seeing = k < ticks - 2
        frame = crop_resize(camera.capture(simulation.data, rng)) if seeing else None
        grasp_map = None
        if frame is not None:
            quality = rng.random(frame.depth.shape).astype(np.float32)
            grasp_map = GraspMap(
                quality=quality,
                angle=(quality - 0.5) * 3,
                width=quality * 60,
                depth=inpaint(frame.depth),
                intrinsics=frame.intrinsics,
                T_world_camera=frame.T_world_camera,
                time=frame.time,
            )
        grids: dict[str, Any] = {
            "entropy": rng.random((20, 30)),
            "utility": rng.random((20, 30)),
            "peak": True,
            "cost": 0.3,
        }
        recorder.tick(
            TickRecord(
                phase="reach" if seeing else "lift",
                simulation=simulation,
                frame=frame,
                grasp_map=grasp_map,
                diagnostics=grids if seeing else {},
                twist_commanded=np.arange(6.0),
                twist_achieved=np.arange(6.0) / 2,
                min_singular_value=0.2 - 0.01 * k,
                manipulability=0.1,
                grasp=None if seeing else GRASP,
                event="reflex: joint 3 too fast" if k == ticks - 1 else None,
            )
        )
    recorder.finish("success")


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
    _play(RerunRecorder(path), simulation)
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


def test_a_film_shows_the_episode_and_ends_with_its_outcome(simulation: Any, tmp_path: Path) -> None:
    film, strip = tmp_path / "film.gif", tmp_path / "strip.png"
    _play(FilmRecorder(film, strip, FilmConfig(backend="ray")), simulation)
    with Image.open(film) as animation:
        assert animation.size == SIZE
        assert 4 <= animation.n_frames <= 7  # type: ignore[attr-defined]
        durations = []
        for k in range(animation.n_frames):  # type: ignore[attr-defined]
            animation.seek(k)
            durations.append(animation.info["duration"])
        assert durations[-1] == 1500
        assert sum(durations[:-1]) == pytest.approx(600, abs=20)
    with Image.open(strip) as sheet:
        assert sheet.size == (3 * SIZE[0], 2 * SIZE[1])
    assert film.stat().st_size < 3_000_000


def test_a_film_too_large_keeps_fewer_pictures_of_the_same_time(simulation: Any, tmp_path: Path) -> None:
    recorders = [
        FilmRecorder(tmp_path / f"{size}.gif", config=FilmConfig(backend="ray", max_bytes=size))
        for size in (3_000_000, 60_000)
    ]
    _play(TeeRecorder(*recorders), simulation, ticks=12)
    lengths = []
    for recorder in recorders:
        with Image.open(recorder.path) as animation:
            total = 0
            for k in range(animation.n_frames):  # type: ignore[attr-defined]
                animation.seek(k)
                total += animation.info["duration"]
            lengths.append((animation.n_frames, total))  # type: ignore[attr-defined]
    assert lengths[1][0] < lengths[0][0]
    assert lengths[1][1] == pytest.approx(lengths[0][1], abs=200)


@pytest.mark.parametrize("backend", ["auto", "ray"])
def test_the_watcher_sees_the_red_stick(simulation: Any, backend: str) -> None:
    watcher = Watcher(simulation.model, backend)
    picture = watcher.picture(simulation.data, looking_down([0.5, 0.0, 0.4])).astype(int)
    watcher.close()
    height, width = picture.shape[:2]
    middle = picture[height // 2, width // 2 - 20]
    assert middle[0] > 2 * middle[1]
    assert np.ptp(picture[20, 20]) < 40


def test_a_long_film_is_thinned_out_while_it_is_made(
    simulation: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mpgrasp.recording.film._MOST", 5)
    recorder = FilmRecorder(tmp_path / "film.gif", config=FilmConfig(backend="ray"))
    start = simulation.time
    _play(recorder, simulation, ticks=14)
    assert len(recorder.pictures) == len(recorder.times) <= 6  # and the outcome
    assert recorder.times[0] - start < 0.2
    assert recorder.times[-1] - start > 1.0
    steps = np.diff(recorder.times[:-2])  # the reflex of the last tick is shown at once
    assert steps == pytest.approx(steps[0], abs=0.02)
    assert steps[0] > 0.3


def test_webp_films_are_written_too(simulation: Any, tmp_path: Path) -> None:
    film = tmp_path / "film.webp"
    _play(FilmRecorder(film, config=FilmConfig(backend="ray")), simulation)
    with Image.open(film) as animation:
        assert animation.format == "WEBP"


def test_a_film_of_an_episode_without_ticks_still_shows_the_outcome(simulation: Any, tmp_path: Path) -> None:
    film = FilmRecorder(tmp_path / "film.gif", config=FilmConfig(backend="ray"))
    film.start(simulation)
    film.finish("timeout")
    assert film.path.stat().st_size > 0


@pytest.mark.parametrize(
    ("make", "name"),
    [(RerunRecorder, "a.rrd"), (FilmRecorder, "a.gif")],
)
def test_places_that_cannot_be_written_are_refused_before_the_episode(
    make: Callable[[Path], Any], name: str, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        make(tmp_path / "file" / name)
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match="cannot be written"):
        make(tmp_path / name)
    with pytest.raises(OutputError, match="unknown kind"):
        make(tmp_path / "a.xyz")


def test_claiming_a_file_makes_its_directory(tmp_path: Path) -> None:
    assert claim_file(tmp_path / "a" / "b" / "c.RRD", (".rrd",)).is_file()


def test_tee_tells_all_in_order() -> None:
    told: list[str] = []

    class Listener(NullRecorder):
        def __init__(self, name: str) -> None:
            self.name = name

        def finish(self, event: str) -> None:
            told.append(self.name + event)

    TeeRecorder(Listener("a"), Listener("b")).finish("!")
    assert told == ["a!", "b!"]


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


def test_shading_runs_from_dark_to_bright_and_marks_holes() -> None:
    picture = shade(np.array([[0.0, 0.5, 1.0, np.nan]]), 0.0, 1.0).astype(int)
    brightness = picture[0, :3].sum(axis=1)
    assert (np.diff(brightness) > 0).all()
    assert tuple(picture[0, 3]) == HOLE
    depth = shade_depth(np.array([[0.4, 0.5, np.nan]])).astype(int)
    assert depth[0, 0].sum() > depth[0, 1].sum()
    assert (shade_depth(np.full((2, 2), np.nan)) == HOLE).all()


def test_angles_half_a_turn_apart_have_one_colour() -> None:
    one, other = np.array([[-np.pi / 2 + 0.01]]), np.array([[np.pi / 2 + 0.01]])
    weight = np.ones((1, 1))
    np.testing.assert_array_equal(shade_lines(one, weight), shade_lines(other, weight))


def test_filmstrip_places_pictures_row_by_row(tmp_path: Path) -> None:
    pictures = [np.full((4, 6, 3), shade_, np.uint8) for shade_ in (0, 80, 160, 240)]
    filmstrip(tmp_path / "s.png", pictures)
    sheet = np.asarray(Image.open(tmp_path / "s.png").convert("RGB"))
    assert sheet.shape == (8, 18, 3)
    assert (sheet[5, 1] == 240).all()


def test_transform_of_grasp_is_a_rotation() -> None:
    T = GRASP.T_world_grasp()
    np.testing.assert_allclose(T, transform(T[:3, :3], GRASP.position))
