"""A URDF of one rigid body is its mesh, in the unit and with the mass and friction that it says."""

from __future__ import annotations

from pathlib import Path

import pytest
from toy_meshes import box

from mpgrasp.bench.meshes.check import examine
from mpgrasp.bench.meshes.facts import FILE
from mpgrasp.bench.meshes.files import find_objects
from mpgrasp.bench.meshes.urdf import read_urdf
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.config import SceneConfig

BODY = """<robot name="thing"><link name="base">{contact}{inertial}
<visual><geometry><mesh filename="{visual}"/></geometry></visual>
<collision><origin xyz="0 0 1"/><geometry><mesh filename="{file}" scale="{scale}"/></geometry></collision>
</link></robot>"""
MASS = '<inertial><mass value="0.21"/></inertial>'
FRICTION = '<contact><lateral_friction value="0.6"/></contact>'


def urdf(path: Path, file: str = "box.stl", **told: str) -> Path:
    words = {"contact": FRICTION, "inertial": MASS, "visual": "look.dae", "scale": "0.001 0.001 0.001"}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(BODY.format(file=file, **(words | told)))
    return path


def test_it_says_mesh_unit_mass_and_friction(tmp_path: Path) -> None:
    mesh = box(tmp_path / "box.stl", (40, 50, 60))
    (found,) = find_objects([str(urdf(tmp_path / "crate.urdf"))], scale=5.0)
    assert (found.name, found.path, found.scale) == ("crate", mesh, 0.001)
    verdict = examine(found, SceneConfig(), 1000.0)
    assert verdict.model is not None
    assert verdict.model.mass == pytest.approx(0.21)
    assert verdict.model.friction == 0.6
    assert sorted(verdict.model.size) == pytest.approx([0.04, 0.05, 0.06])


def test_without_mass_and_friction_it_is_like_a_mesh(tmp_path: Path) -> None:
    box(tmp_path / "box.stl")
    told = read_urdf(urdf(tmp_path / "crate.urdf", contact="", inertial="", scale="1 1 1"))
    assert (told.facts.mass, told.facts.friction, told.scale) == (None, None, 1.0)


def test_in_a_folder_its_mesh_is_no_object_of_its_own(tmp_path: Path) -> None:
    box(tmp_path / "box.stl")
    box(tmp_path / "other.stl")
    urdf(tmp_path / "crate.urdf")
    box(tmp_path / "mug" / "shape.stl")
    urdf(tmp_path / "mug" / "model.urdf", "package://things/mug/shape.stl")
    assert [found.name for found in find_objects([str(tmp_path)])] == ["crate", "other", "mug"]
    (tmp_path / FILE).write_text("[mug]\nmass = 0.5\n[crate]\nfriction = 0.9\n")
    facts = [found.facts for found in find_objects([str(tmp_path)])]
    assert [known.mass for known in facts] == [0.21, None, 0.5]
    assert [known.friction for known in facts] == [0.9, None, 0.6]
    (tmp_path / FILE).write_text("[crate]\ndensity = 700\n")
    crate = find_objects([str(tmp_path)])[0].facts
    assert (crate.mass, crate.density, crate.friction) == (None, 700, 0.6)


def test_a_mesh_of_its_package_is_found(tmp_path: Path) -> None:
    mesh = box(tmp_path / "pack" / "meshes" / "box.stl")
    for name in ("package://pack/meshes/box.stl", "../meshes/box.stl", "file://../meshes/box.stl"):
        assert read_urdf(urdf(tmp_path / "pack" / "urdf" / "a.urdf", name)).mesh.resolve() == mesh.resolve()


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"file": "none.stl"}, "the mesh of a URDF is not there; got 'none.stl'"),
        ({"file": ""}, "is not there"),
        ({"scale": "1 2 1"}, "scaled unevenly; got '1 2 1'"),
        ({"scale": "1 1"}, "scaled unevenly"),
        ({"scale": "a b c"}, "scaled unevenly"),
        ({"scale": "-1 -1 -1"}, "scaled unevenly"),
        ({"inertial": '<inertial><mass value="heavy"/></inertial>'}, "mass is no number; got 'heavy'"),
        ({"inertial": '<inertial><mass value="900"/></inertial>'}, "mass out of range"),
        ({"contact": '<contact><lateral_friction value="nan"/></contact>'}, "friction is no number"),
    ],
    ids=str,
)
def test_what_cannot_be_is_refused(told: dict[str, str], said: str, tmp_path: Path) -> None:
    box(tmp_path / "box.stl")
    with pytest.raises(ConfigError, match=said):
        read_urdf(urdf(tmp_path / "crate.urdf", **told))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("no XML", "cannot be read"),
        ("<robot/>", "0 bodies with meshes"),
        (
            "<robot>" + "".join(
                f'<link name="{k}"><collision><geometry><mesh filename="a"/></geometry></collision></link>'
                for k in range(2)
            ) + "</robot>",
            "2 bodies with meshes, 1 meshes",
        ),
    ],
    ids=["text", "nothing", "two"],
)  # fmt: skip
def test_other_robots_are_refused(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "a.urdf").write_text(text)
    with pytest.raises(ConfigError, match=said):
        read_urdf(tmp_path / "a.urdf")
