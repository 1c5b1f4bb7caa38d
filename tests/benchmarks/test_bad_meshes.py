"""No mesh file that is none, or that no hand could take, becomes an object: one reason says why."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("trimesh")

from bad_meshes import BAD_MESHES, BadMesh
from mesh_writers import ball, box, obj, ply, stl, strip, text_stl, together

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.meshes.check import examine
from mpgrasp.bench.meshes.files import find_objects
from mpgrasp.exceptions import MpgraspError
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.from_mesh import read_body

FIRST_SEEN = {name: bad for name, bad in BAD_MESHES.items() if not bad.dropped}
SCENE = SceneConfig(objects=("it",))


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning would be a second line for the user
        yield


def reason(path: Path) -> str:
    try:
        (file,) = find_objects([str(path)])
    except MpgraspError as error:
        return str(error)
    return examine(file, SCENE, 500.0).reason or "accepted"


@pytest.mark.parametrize("bad", FIRST_SEEN.values(), ids=FIRST_SEEN)
def test_a_bad_mesh_is_refused_with_its_reason(bad: BadMesh, tmp_path: Path) -> None:
    said = reason(bad.write(tmp_path))
    assert re.search(bad.said, said, re.DOTALL), said
    assert "Traceback" not in said
    assert "\n" not in said
    assert len(said) < 400
    assert said == reason(tmp_path / f"bad{bad.suffix}")  # out of the cache, where that is where it is


def test_there_are_many() -> None:
    assert len(BAD_MESHES) >= 75


@pytest.mark.parametrize(
    "name", ["stl-truncated", "pipe", "endless", "obj-from-zero", "apart", "folder", "huge", "ply-trillion"]
)
def test_the_command_ends_with_one_line_and_2(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = BAD_MESHES[name].write(tmp_path)
    out = tmp_path / "run"
    command = ["single", "--detector", "oracle", "--objects", str(path), "--workers", "0", "--quiet"]
    assert main([*command, "--episodes", "1", "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert said.err.startswith("mpgrasp: error: ")
    assert re.search(BAD_MESHES[name].said, said.err)
    assert not out.exists()


_VERTICES = obj(box()).split(b"f ", 1)[0]
_COUNTED_BACK = b"".join(b"f %d %d %d\n" % tuple(face - 8) for face in box().faces)
SOUND = {
    "box.stl": stl(box()),
    "box-as-text.stl": text_stl(box()),
    "box.obj": obj(box()),
    "box.ply": ply(box()),
    "box-binary.ply": ply(box(), form="binary_little_endian 1.0"),
    "latin-1.obj": "# caf\u00e9\n".encode("latin-1") + obj(box()),
    "solid-in-the-header.stl": b"solid" + stl(box())[5:],
    "inside-out.stl": stl(box().turned_out()),
    "counted-back.obj": _VERTICES + _COUNTED_BACK,
}


@pytest.mark.parametrize("name", SOUND)
def test_the_same_mesh_without_the_flaw_is_read_from_every_kind_of_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(SOUND[name])
    body = read_body(tmp_path / name)
    assert body.size == pytest.approx((0.03, 0.03, 0.03))
    assert body.volume == pytest.approx(0.03**3, rel=1e-5)


def test_the_surfaces_that_flaws_are_made_from_are_closed() -> None:
    import trimesh

    for surface, volume in ((box(0.01, 0.02, 0.03), 6e-6), (ball(0.03, 40), 4 / 3 * 3.14159265 * 0.03**3)):
        mesh = trimesh.Trimesh(*surface)
        assert mesh.is_volume
        assert mesh.volume == pytest.approx(volume, rel=0.01)
    assert trimesh.Trimesh(*together(box(), box().moved(0.1))).body_count == 2
    assert trimesh.Trimesh(*strip(0)).is_winding_consistent
    assert not trimesh.Trimesh(*strip(1)).is_winding_consistent


@pytest.mark.parametrize("name", [name for name, bad in BAD_MESHES.items() if bad.dropped])
def test_what_no_hand_can_take_is_dropped_before_it_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mpgrasp.bench.meshes.check.REST_POSES", 1)
    bad = BAD_MESHES[name]
    (file,) = find_objects([str(bad.write(tmp_path))])
    verdict = examine(file, replace(SCENE, count=None), 500.0)
    assert re.search(bad.said, verdict.reason or "accepted")
    assert len(verdict.qualities) == 1
