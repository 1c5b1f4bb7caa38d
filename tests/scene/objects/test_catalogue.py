from __future__ import annotations

from collections import Counter
from pathlib import Path

import mujoco
import numpy as np
import pytest

from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.paths import OBJECT_ASSETS, SCENES
from mpgrasp.scene.objects.catalogue import OBJECT_SETS, load_object, read_pieces
from mpgrasp.scene.objects.free_body import add_object
from mpgrasp.scene.objects.model import ObjectModel, Part

NAMES = [name for names in OBJECT_SETS.values() for name in names]
MESHES = sorted(OBJECT_ASSETS.glob("*.obj"))


def test_every_set_of_the_issue_is_there() -> None:
    assert OBJECT_SETS["thin"] == ("usb_stick", "key", "ruler", "pen", "card_stack", "washer", "plate_brick")
    assert len(OBJECT_SETS["toys"]) == 4
    assert len(NAMES) == len(set(NAMES))


@pytest.mark.parametrize("name", NAMES)
def test_catalogue_object_has_sane_size_mass_and_density(name: str) -> None:
    model = load_object(name)
    assert 0.01 < max(model.size) < 0.25
    assert min(model.size[:2]) < 0.11
    assert 0.001 < model.mass < 0.5
    assert 100 < model.mass / model.volume < 8000  # wood and foam to steel
    assert 0.3 < model.friction < 1
    assert model.provenance


@pytest.mark.parametrize("name", [*OBJECT_SETS["thin"], *OBJECT_SETS["toys"]])
def test_thin_objects_and_toys_fit_between_the_fingers(name: str) -> None:
    assert sorted(load_object(name).size)[1] < 0.07


@pytest.mark.parametrize("name", OBJECT_SETS["thin"])
def test_thin_objects_are_thin(name: str) -> None:
    assert load_object(name).size[2] < 0.013


@pytest.mark.parametrize("name", NAMES)
def test_frame_is_at_the_bounding_boxs_centre(name: str) -> None:
    points = load_object(name).points
    np.testing.assert_allclose(points.min(axis=0) + points.max(axis=0), 0, atol=5e-6)


@pytest.mark.parametrize("path", MESHES, ids=lambda path: path.stem)
def test_mesh_pieces_are_watertight_convex_and_wound_outwards(path: Path) -> None:
    vertices = np.array(
        [line.split()[1:] for line in path.read_text().splitlines() if line[:2] == "v "], float
    )
    groups: list[list[list[int]]] = []
    for line in path.read_text().splitlines():
        if line.startswith("o "):
            groups.append([])
        elif line.startswith("f "):
            groups[-1].append([int(word) - 1 for word in line.split()[1:]])
    assert len(groups) == len(read_pieces(path))
    for group in groups:
        faces = np.array(group)
        edges = Counter((int(f[i]), int(f[(i + 1) % 3])) for f in faces for i in range(3))
        assert all(n == 1 and edges[b, a] == 1 for (a, b), n in edges.items())
        corners = vertices[faces]  # (n_faces, 3, 3)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        used = vertices[np.unique(faces)]
        above = np.einsum("fpc,fc->fp", used[None] - corners[:, :1], normals)
        assert above.max() < 2e-6  # files are rounded to a micrometre


@pytest.mark.parametrize("name", NAMES)
def test_mass_in_the_model_is_the_declared_mass(name: str) -> None:
    spec = mujoco.MjSpec.from_file(str(SCENES / "table.xml"))
    model = load_object(name)
    add_object(spec, model)
    compiled = spec.compile()
    assert compiled.body(name).mass[0] == pytest.approx(model.mass, rel=1e-9)
    assert (np.asarray(compiled.body(name).inertia) > 0).all()


def test_volumes_of_parts_agree_with_those_of_mujoco() -> None:
    tilt = (0.8, 0.6, 0.0, 0.0)
    corners = np.array([[0, 0, 0], [0.03, 0, 0], [0, 0.02, 0], [0, 0, 0.04]])
    parts = [
        Part(shape="box", size=(0.01, 0.02, 0.03), quaternion=tilt),
        Part(shape="cylinder", size=(0.01, 0.02)),
        Part(shape="capsule", size=(0.01, 0.02)),
        Part(shape="ellipsoid", size=(0.01, 0.02, 0.03)),
        Part(shape="mesh", vertices=corners),
    ]
    for part in parts:
        spec = mujoco.MjSpec()
        body = add_object(spec, ObjectModel(name="o", parts=(part,), mass=1.0))
        for geom in body.geoms:
            geom.mass, geom.density = float("nan"), 1000.0
        assert spec.compile().body_mass[1] == pytest.approx(1000 * part.volume, rel=1e-6), part.shape


def test_points_span_the_part_in_its_pose() -> None:
    lying = Part(
        shape="cylinder", size=(0.01, 0.05), position=(0.1, 0, 0), quaternion=(0.5**0.5, 0, 0.5**0.5, 0)
    )
    np.testing.assert_allclose(lying.points.min(axis=0), [0.05, -0.01, -0.01], atol=1e-4)
    np.testing.assert_allclose(lying.points.max(axis=0), [0.15, 0.01, 0.01], atol=1e-4)


def test_unknown_object_names_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="usb_stick"):
        load_object("usb")


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan"), float("inf")])
def test_mass_that_is_not_positive_is_refused(mass: float) -> None:
    with pytest.raises(AssetError, match="mass"):
        ObjectModel(name="o", parts=(Part(shape="box", size=(0.01, 0.01, 0.01)),), mass=mass)


@pytest.mark.parametrize("size", [(0.01, 0.01), (0.01, 0.01, 0.0), (0.01, 0.01, float("nan"))])
def test_unusable_part_is_refused(size: tuple[float, ...]) -> None:
    with pytest.raises(AssetError, match="size"):
        Part(shape="box", size=size)


@pytest.mark.parametrize(
    "pose", [{"position": (0.1,)}, {"quaternion": (1.0, 0.0, 0.0)}, {"position": (0, 0, np.nan)}]
)
def test_unusable_pose_of_a_part_is_refused(pose: dict[str, tuple[float, ...]]) -> None:
    with pytest.raises(AssetError, match=r"position|quaternion"):
        Part(shape="box", size=(0.01, 0.01, 0.01), **pose)  # type: ignore[arg-type]
