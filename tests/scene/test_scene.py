from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.paths import SCENES
from mpgrasp.robot.panda import Q_HOME
from mpgrasp.scene.__main__ import main
from mpgrasp.scene.cloth import HALF_EXTENT, make_cloth
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.export import save_scene
from mpgrasp.scene.objects.catalogue import OBJECT_SETS
from mpgrasp.scene.objects.free_body import add_object
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.settling import REGION_TOLERANCE
from mpgrasp.workspace import WORKSPACE_CENTRE

FLAT = SceneConfig(cloth_unevenness=0.0)
THIN = SceneConfig(objects=OBJECT_SETS["thin"], half_extent=0.2)
PILE = SceneConfig(objects=OBJECT_SETS["toys"], placing="pile", pose="random")


def _box(name: str, x: float, y: float, z: float, mass: float = 0.1) -> ObjectModel:
    return ObjectModel(name=name, parts=(Part(shape="box", size=(x / 2, y / 2, z / 2)),), mass=mass)


def _poses(scene: Scene, data: mujoco.MjData) -> np.ndarray:
    return np.array([np.r_[data.body(n).xpos, data.body(n).xquat] for n in scene.objects])


@pytest.mark.parametrize("config", [FLAT, THIN, PILE], ids=["flat", "thin", "pile"])
@pytest.mark.parametrize("robot", [False, True])
def test_same_config_and_seed_give_identical_bytes(config: SceneConfig, robot: bool) -> None:
    first, second = (build_scene(config, 0, robot=robot) for _ in range(2))
    assert first.state.tobytes() == second.state.tobytes()
    assert first.cloth.elevation.tobytes() == second.cloth.elevation.tobytes()


def test_other_scenes_built_in_between_change_nothing() -> None:
    first = build_scene(PILE, 5)
    np.random.default_rng(0).random(100)
    build_scene(THIN, 1)
    assert build_scene(PILE, 5).state.tobytes() == first.state.tobytes()


def test_seeds_differ_in_poses_and_cloth() -> None:
    scenes = [build_scene(SceneConfig(), seed, robot=False) for seed in range(4)]
    assert len({s.state.tobytes() for s in scenes}) == 4
    assert len({s.cloth.elevation.tobytes() for s in scenes}) == 4


def test_cloth_of_a_seed_does_not_depend_on_the_objects() -> None:
    a, b = build_scene(SceneConfig(), 3, robot=False), build_scene(THIN, 3, robot=False)
    assert a.cloth.elevation.tobytes() == b.cloth.elevation.tobytes()


@pytest.mark.parametrize("config", [FLAT, PILE], ids=["flat", "pile"])
def test_objects_lie_the_same_with_and_without_the_robot(config: SceneConfig) -> None:
    poses = []
    for robot in (False, True):
        scene = build_scene(config, 2, robot=robot)
        poses.append(_poses(scene, scene.data()))
    np.testing.assert_array_equal(poses[0], poses[1])


@pytest.mark.parametrize("config", [SceneConfig(), THIN, PILE], ids=["stick", "thin", "pile"])
@pytest.mark.parametrize("seed", [0, 1])
def test_objects_rest_within_the_region(config: SceneConfig, seed: int) -> None:
    scene = build_scene(config, seed, robot=False)
    data = scene.data()
    before = _poses(scene, data)
    assert np.abs(before[:, :2] - config.centre).max() <= config.half_extent + REGION_TOLERANCE
    mujoco.mj_step(scene.model, data, 1000)
    assert np.linalg.norm(_poses(scene, data) - before, axis=1).max() < 0.005
    assert np.abs(data.qvel).max() < 0.05


def test_the_centre_of_the_region_is_drawn_within_its_spread_and_the_pile_lies_about_it() -> None:
    fixed = dataclasses.replace(PILE, half_extent=0.1)
    centres = []
    for seed in range(6):
        scene = build_scene(dataclasses.replace(fixed, centre_spread=0.2), seed, robot=False)
        places = _poses(scene, scene.data())[:, :2]
        assert np.ptp(places, axis=0).max() <= 2 * (fixed.half_extent + REGION_TOLERANCE)
        assert np.abs(places - fixed.centre).max() <= 0.2 + fixed.half_extent + REGION_TOLERANCE
        centres.append(places.mean(axis=0))
    assert np.ptp(centres, axis=0).min() > 0.15
    with pytest.raises(ConfigError, match=r"spread of the placing region's centre .*; got 0\.5"):
        dataclasses.replace(fixed, centre_spread=0.5)


def test_arm_stays_at_home() -> None:
    scene = build_scene(SceneConfig(), 0)
    data = scene.data()
    mujoco.mj_step(scene.model, data, 500)
    arm = [data.joint(f"panda/joint{k}").qpos[0] for k in range(1, 8)]
    np.testing.assert_allclose(arm, Q_HOME, atol=1e-4)


def test_count_draws_by_the_seed_and_names_stay_unique() -> None:
    config = SceneConfig(objects=OBJECT_SETS["thin"], count=2)
    drawn = {build_scene(config, seed, robot=False).objects for seed in range(8)}
    assert len(drawn) > 3
    assert all(len(set(names)) == 2 for names in drawn)
    twins = build_scene(SceneConfig(objects=("usb_stick", "usb_stick")), 0, robot=False)
    assert twins.objects == ("usb_stick", "usb_stick_2")


def test_camouflaged_objects_have_the_colour_of_the_cloth() -> None:
    model = build_scene(SceneConfig(camouflage=True), 0, robot=False).model
    np.testing.assert_array_equal(model.geom("usb_stick/0").rgba, model.geom("cloth").rgba)


@pytest.mark.parametrize("unevenness", [0.0003, 0.0006, 0.0015])
def test_unevenness_of_the_cloth_is_as_asked(unevenness: float) -> None:
    config = SceneConfig(cloth_unevenness=unevenness)
    h = build_scene(config, 1, robot=False).height_map(cell=0.004, half_extent=0.36)
    assert h.support.std() == pytest.approx(unevenness, rel=0.1)
    assert h.support.min() >= 0


@pytest.mark.parametrize("wavelength", [0.06, 0.12])
def test_crests_of_the_cloth_are_a_wavelength_apart(wavelength: float) -> None:
    x = np.arange(-0.37, 0.37, 0.001)
    gaps = []
    for seed in range(4):
        cloth = make_cloth(0.001, wavelength, np.random.default_rng(seed))
        lines = cloth.height(WORKSPACE_CENTRE[0] + x[None, :], np.linspace(-0.3, 0.3, 9)[:, None])
        lines = lines - lines.mean()
        crossings = ((lines[:, :-1] < 0) & (lines[:, 1:] >= 0)).sum(axis=1)
        gaps.append(np.ptp(x) / crossings.mean())
    assert np.mean(gaps) == pytest.approx(wavelength, rel=0.15)


def test_flat_cloth_is_flat() -> None:
    h = build_scene(FLAT, 0, robot=False).height_map()
    assert (h.support == 0).all()


def test_cloth_ends_level_with_the_table() -> None:
    cloth = make_cloth(0.001, 0.06, np.random.default_rng(0))
    edge = HALF_EXTENT - 1e-9
    along = np.linspace(-edge, edge, 50)
    assert np.abs(cloth.height(WORKSPACE_CENTRE[0] + along, np.full(50, edge))).max() < 1e-9
    assert cloth.height(np.array(WORKSPACE_CENTRE[0] + 1.0), np.array(0.0)) == 0


def test_cloth_heights_agree_with_rays() -> None:
    scene = build_scene(SceneConfig(cloth_unevenness=0.0015), 4, robot=False)
    data, cloth = scene.data(), scene.model.geom("cloth").id
    rng = np.random.default_rng(0)
    for x, y in rng.uniform(-0.4, 0.4, (100, 2)) + WORKSPACE_CENTRE:
        ray = mujoco.mj_rayHfield(scene.model, data, cloth, np.array([x, y, 1.0]), np.array([0, 0, -1.0]))
        assert scene.cloth.height(x, y) == pytest.approx(1 - ray, abs=2e-7)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("robot", [False, True])
def test_height_map_of_a_box_is_analytic(seed: int, robot: bool) -> None:
    config = SceneConfig(objects=(_box("crate", 0.08, 0.05, 0.04),), cloth_unevenness=0.0)
    scene = build_scene(config, seed, robot=robot)
    data, h = scene.data(), scene.height_map(cell=0.004, half_extent=0.2)
    centre, R = data.body("crate").xpos, data.body("crate").xmat.reshape(3, 3)
    ny, nx = h.height.shape
    x, y = np.meshgrid(h.x0 + h.cell * np.arange(nx), h.y0 + h.cell * np.arange(ny))
    u, v, _ = np.moveaxis(np.stack([x, y, np.full_like(x, centre[2])], -1) - centre, -1, 0).reshape(3, -1)
    along = np.abs(R[:2, :2].T @ np.stack([u, v])).reshape(2, ny, nx)  # in the box's own axes
    margin = 1e-4
    inside = (along[0] < 0.04 - margin) & (along[1] < 0.025 - margin)
    outside = (along[0] > 0.04 + margin) | (along[1] > 0.025 + margin)
    np.testing.assert_allclose(h.height[inside], 0.04, atol=1e-5)  # contacts give a few micrometres
    np.testing.assert_allclose(h.height[outside], 0, atol=1e-9)
    assert (h.label[inside] == 1).all()
    assert (h.label[outside] == 0).all()
    assert inside.sum() > 200


def test_labels_name_the_object_under_each_cell() -> None:
    scene = build_scene(THIN, 0, robot=False)
    data, h = scene.data(), scene.height_map()
    assert set(np.unique(h.label)) == set(range(len(scene.objects) + 1))
    assert ((h.height > h.support) == (h.label > 0)).all()
    for k, name in enumerate(scene.objects):
        rows, cols = np.nonzero(h.label == k + 1)
        reach = np.linalg.norm(scene.object_models[k].size) / 2 + h.cell
        away = np.hypot(
            h.x0 + cols * h.cell - data.body(name).xpos[0], h.y0 + rows * h.cell - data.body(name).xpos[1]
        )
        assert away.max() < reach


def test_resting_stack_of_six_boxes_stays_put_for_ten_seconds() -> None:
    spec = mujoco.MjSpec.from_file(str(SCENES / "table.xml"))
    for k in range(6):
        add_object(spec, _box(f"box_{k}", 0.05, 0.05, 0.03, mass=0.05), [0.5, 0, 0.015 + 0.03 * k])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = data.xpos.copy()
    for _ in range(10):
        mujoco.mj_step(model, data, 500)
        assert np.linalg.norm(data.xpos - start, axis=1).max() < 0.001


@pytest.mark.parametrize("thickness", [0.003, 0.008])
def test_light_thing_squeezed_with_forty_newtons_gives_less_than_its_grip(thickness: float) -> None:
    """Two pads press a 10 g stick in the air: it neither drops nor is sunk into."""
    spec = mujoco.MjSpec.from_file(str(SCENES / "table.xml"))
    add_object(spec, _box("stick", 0.05, 0.02, thickness, mass=0.01), [0.5, 0, 0.3])
    for side in (-1, 1):
        pad = spec.worldbody.add_body(name=f"pad{side}", pos=[0.5, side * 0.0152, 0.3])
        pad.add_joint(name=f"slide{side}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, -side, 0], armature=0.2)
        pad.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.009, 0.005, 0.009], mass=0.02)
        motor = spec.add_actuator(
            name=f"push{side}", target=f"slide{side}", trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        motor.gainprm[0] = 1
    model = spec.compile()
    data = mujoco.MjData(model)
    data.ctrl[:] = 40.0
    mujoco.mj_step(model, data, 250)
    held = data.body("stick").xpos.copy()
    assert 0.3 - held[2] < 0.002
    gap = data.body("pad1").xpos[1] - data.body("pad-1").xpos[1] - 0.01
    assert 0.02 - gap < 0.0004
    mujoco.mj_step(model, data, 5000)
    assert np.linalg.norm(data.body("stick").xpos - held) < 0.001


def test_build_refuses_what_it_cannot_place() -> None:
    with pytest.raises(ConfigError, match="seed"):
        build_scene(SceneConfig(), -1)
    with pytest.raises(ConfigError, match="unknown object"):
        build_scene(SceneConfig(objects=("teapot",)), 0)
    # a pole topples out of a region that is a point, wherever it is dropped
    pole = SceneConfig(objects=(_box("pole", 0.01, 0.01, 0.29),), half_extent=0.0, cloth_unevenness=0.0015)
    with pytest.raises(ConfigError, match="rest"):
        build_scene(pole, 0, robot=False)


@pytest.mark.parametrize(
    "settings",
    [
        {"placing": "throw"},
        {"pose": "upside down"},
        {"count": 0},
        {"count": 2},
        {"cloth_unevenness": -0.001},
        {"cloth_unevenness": float("nan")},
        {"cloth_wavelength": 0.0},
        {"half_extent": 1.0},
        {"centre": (0.5,)},
        {"centre": (0.5, float("inf"))},
    ],
)
def test_unusable_settings_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        SceneConfig(**settings)


def test_config_reads_lists_as_declarations_give_them() -> None:
    declared = tomllib.loads('objects = ["usb_stick", "key"]\ncentre = [0.45, 0.1]')
    assert SceneConfig(**declared) == SceneConfig(objects=("usb_stick", "key"), centre=(0.45, 0.1))


@pytest.mark.parametrize("robot", [False, True])
def test_saved_scene_opens_anywhere_and_rests(tmp_path: Path, robot: bool) -> None:
    scene = build_scene(dataclasses.replace(PILE, basket=True), 1, robot=robot)
    (tmp_path / "here").mkdir()
    save_scene(scene, tmp_path / "here" / "world.xml")
    (tmp_path / "here").rename(tmp_path / "there")
    text = (tmp_path / "there" / "world.xml").read_text()
    assert str(tmp_path) not in text
    assert "site-packages" not in text
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "there" / "world.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    np.testing.assert_allclose(data.qpos, scene.data().qpos, atol=1e-4)
    start = data.qpos.copy()
    mujoco.mj_step(model, data, 500)
    assert np.abs(data.qpos - start).max() < 0.005
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC


def test_unwritable_scene_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        save_scene(build_scene(FLAT, 0, robot=False), tmp_path / "file" / "scene.xml")


def test_command_writes_the_scene_of_a_suite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["thin", "--seed", "3", "--out", str(tmp_path / "scene.xml")]) == 0
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml")).body("usb_stick").mass[0] > 0
    assert "usb_stick" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [["nope"], ["thin", "--seed", "-1"], ["thin", "--seed", "x"], []])
def test_bad_command_gets_one_line_and_exit_code_two(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("mpgrasp: error: ")
    assert error.count("\n") == 1
