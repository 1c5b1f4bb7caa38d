"""Objects from mesh files."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from toy_meshes import EDGES, box, half_ball, open_box, u_shape, write

from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.scene.objects import from_mesh as mesh_objects
from mpgrasp.scene.objects import surface as mesh_surface
from mpgrasp.scene.objects.from_mesh import MAX_VERTICES, read_body

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("coacd")
pytest.importorskip("fast_simplification")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of one's own."""
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply", ".STL"])
def test_box_is_one_piece_of_its_size_and_mass(tmp_path: Path, suffix: str) -> None:
    path = box(tmp_path / "crate.stl") if suffix == ".STL" else box(tmp_path / f"crate{suffix}")
    body = read_body(path.rename(tmp_path / f"crate{suffix}"))
    assert len(body.pieces) == 1
    np.testing.assert_allclose(body.size, EDGES, rtol=1e-6)
    assert body.as_object("crate", density=250.0).mass == pytest.approx(250 * np.prod(EDGES), rel=1e-6)


def test_a_glb_stands_as_it_does_where_y_points_up(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((0.04, 0.05, 0.06)))
    body = read_body(write(scene, tmp_path / "crate.glb"))
    assert body.size == pytest.approx((0.04, 0.06, 0.05))  # what was deep is wide, what was high is high
    # a node that turns and moves its mesh is obeyed
    turned = trimesh.Scene()
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0), (0.3, 0.1, 0.2))
    turned.add_geometry(trimesh.creation.box((0.04, 0.05, 0.06)), transform=turn)
    assert read_body(write(turned, tmp_path / "t.glb")).size == pytest.approx((0.04, 0.05, 0.06))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda b: b[:-10], "cut off or too long"),
        (lambda b: b + b"0000", "cut off or too long"),
        (lambda b: b"glTG" + b[4:], "without its header"),
        (lambda b: b[:4] + (1).to_bytes(4, "little") + b[8:], "another version; got 1"),
        (lambda b: b[:12] + bytes(len(b) - 12), "unreadable GLB file|mesh is empty"),
    ],
)
def test_a_damaged_glb_is_refused_in_one_line(change: Any, said: str, tmp_path: Path) -> None:
    path = write(trimesh.Scene(trimesh.creation.box((0.04, 0.05, 0.06))), tmp_path / "crate.glb")
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(AssetError, match=said) as caught:
        read_body(path)
    assert "\n" not in str(caught.value)


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
        (lambda: trimesh.creation.box((40, 50, 60)), "is the file in millimetres"),
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


def test_a_binary_stl_that_is_cut_off_says_so(tmp_path: Path) -> None:
    whole = box(tmp_path / "box.stl").read_bytes()
    for content in (whole[:-1], whole[:300], whole[:84], whole + b"x" * 50):
        (tmp_path / "box.stl").write_bytes(content)
        with pytest.raises(AssetError, match=r"cut off or too long; got '\d+ bytes'.*= 684"):
            read_body(tmp_path / "box.stl")


def test_a_text_stl_is_read_and_one_that_is_cut_off_says_so(tmp_path: Path) -> None:
    text = trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box(EDGES))
    (tmp_path / "box.stl").write_text(text)
    np.testing.assert_allclose(read_body(tmp_path / "box.stl").size, EDGES, rtol=1e-5)
    (tmp_path / "box.stl").write_text(text[: len(text) // 2])
    with pytest.raises(AssetError, match="without its end"):
        read_body(tmp_path / "box.stl")


@pytest.mark.parametrize(("suffix", "comment"), [(".obj", "# café\n"), (".ply", "comment café\n")])
def test_comments_in_latin_1_are_no_matter(tmp_path: Path, suffix: str, comment: str) -> None:
    content = box(tmp_path / f"box{suffix}").read_bytes()
    at = 0 if suffix == ".obj" else content.index(b"element")
    path = tmp_path / f"other{suffix}"
    path.write_bytes(content[:at] + comment.encode("latin-1") + content[at:])
    np.testing.assert_allclose(read_body(path).size, EDGES, rtol=1e-5)


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


@pytest.mark.parametrize(
    "content",
    [
        "{", "[]", "{}", '{"pieces": 1}', '{"pieces": [[]], "volume": 1}', '{"pieces": [], "volume": 1}',
        '{"pieces": [[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]], "volume": "much"}', '{"refused": 3}',
    ],
)  # fmt: skip
def test_damaged_cache_is_made_anew(tmp_path: Path, cache: Path, content: str) -> None:
    path = box(tmp_path / "box.stl")
    read_body(path)
    (entry,) = (cache / "meshes").iterdir()
    entry.write_text(content)
    assert len(read_body(path).pieces) == 1
    assert json.loads(entry.read_text())["volume"] > 0


def test_missing_package_is_told_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = box(tmp_path / "box.stl")
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(ConfigError, match=r"coacd.*pip install 'mpgrasp\[objects\]'"):
        read_body(path)
