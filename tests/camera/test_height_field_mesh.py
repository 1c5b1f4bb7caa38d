"""A height field of which the part in view is drawn gives the depth that MuJoCo's own drawing gives."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from toy_world import needs_gl

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.camera.height_field_mesh import HeightFieldMesh, height_field_mesh
from mpgrasp.camera.rasteriser import Rasteriser
from mpgrasp.camera.ray_caster import RayCaster
from mpgrasp.geometry import FloatArray, looking_down, rotation_x
from mpgrasp.linear_algebra import product
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import Scene, build_scene

IMAGE = D435_INTRINSICS.centre_crop(350)
POSES = {
    "high": looking_down([0.5, 0.0, 0.6]),
    "low": looking_down([0.47, 0.05, 0.2], 0.3),
    "turned": looking_down([0.5, -0.1, 0.4], 0.8),
    "aslant": looking_down([0.5, 0.0, 0.4], 0.7),
    "over the cloth's edge": looking_down([0.85, 0.3, 0.4], 0.5),
    "towards the horizon": looking_down([0.5, 0.0, 0.3], 0.7),
}
for _name, _tilt in (("aslant", 0.5), ("towards the horizon", 1.2)):
    POSES[_name][:3, :3] = product(POSES[_name][:3, :3], rotation_x(_tilt))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(SceneConfig(objects=("usb_stick",), cloth_unevenness=0.004), 3)


@pytest.fixture(scope="module")
def drawers(scene: Scene) -> Iterator[tuple[Rasteriser, Rasteriser]]:
    ours, mujocos = Rasteriser(scene.model, IMAGE), Rasteriser(scene.model, IMAGE)
    mujocos._field = None
    yield ours, mujocos
    ours.close()
    mujocos.close()


@needs_gl
@pytest.mark.parametrize("pose", POSES)
def test_depth_is_that_of_mujocos_drawing(
    scene: Scene, drawers: tuple[Rasteriser, Rasteriser], pose: str
) -> None:
    ours, mujocos = (drawer.render(scene.data(), POSES[pose]) for drawer in drawers)
    np.testing.assert_array_equal(np.isnan(ours), np.isnan(mujocos))
    np.testing.assert_allclose(ours, mujocos, rtol=0, atol=5e-5)
    # but where the edge of a triangle runs through the pixel's centre, to rounding
    assert (np.abs(ours - mujocos) > 2e-6).mean() < 1e-4


@needs_gl
def test_depth_is_that_of_rays(scene: Scene, drawers: tuple[Rasteriser, Rasteriser]) -> None:
    drawn = drawers[0].render(scene.data(), POSES["turned"])
    cast = RayCaster(scene.model, IMAGE).render(scene.data(), POSES["turned"])
    # along silhouettes a pixel may go either way
    assert np.quantile(np.abs(drawn - cast), 0.99) < 5e-5


def shown(scene: Scene, T: FloatArray) -> tuple[set[str], int | None]:
    """Names of the arena's geoms that are left to MuJoCo, and the number of squares that are drawn here."""
    mesh = height_field_mesh(scene.model)
    assert mesh is not None
    drawn, option, camera = mujoco.MjvScene(scene.model, 200), mujoco.MjvOption(), mujoco.MjvCamera()
    data = scene.data()
    mujoco.mjv_updateScene(scene.model, data, option, None, camera, mujoco.mjtCatBit.mjCAT_ALL.value, drawn)
    triangles = mesh.take_over(drawn, data, T, IMAGE)
    left = [g for g in drawn.geoms[: drawn.ngeom] if g.type != mujoco.mjtGeom.mjGEOM_NONE.value]
    names = {scene.model.geom(g.objid).name for g in left if g.objtype == mujoco.mjtObj.mjOBJ_GEOM.value}
    return names & {"cloth", "table", "floor"}, None if triangles is None else triangles.size // 6


@pytest.mark.parametrize(
    ("pose", "left"),
    [
        ("high", set()),
        ("low", set()),
        ("over the cloth's edge", {"table", "floor"}),
        ("towards the horizon", {"table", "floor", "cloth"}),
    ],
)
def test_what_the_field_hides_is_left_out_only_where_the_field_fills_the_view(
    scene: Scene, pose: str, left: set[str]
) -> None:
    assert shown(scene, POSES[pose])[0] == left


def test_the_nearer_the_fewer_squares(scene: Scene) -> None:
    numbers = [shown(scene, looking_down([0.5, 0.0, z]))[1] for z in (0.2, 0.4, 0.6)]
    assert all(number is not None for number in numbers)
    near, middle, far = (number or 0 for number in numbers)
    assert near < middle < far < 120 * 120
    # what is seen of a plane grows with the square of the distance, and margins of a square all around
    assert near <= (0.2 * IMAGE.width / IMAGE.fx / 0.007 + 4) ** 2


@pytest.mark.parametrize(
    "field",
    ["", '<geom type="hfield" hfield="h"/>', '<geom type="hfield" hfield="h"/>' * 2],
    ids=["none", "whose border is not at its zero", "two"],
)
def test_other_worlds_are_left_to_mujoco(field: str) -> None:
    heights = " ".join(str(k % 3) for k in range(9))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><hfield name="h" nrow="3" ncol="3" size="1 1 .1 .1" elevation="{heights}"/></asset>'
        f'<worldbody><geom type="sphere" size=".1"/>{field}</worldbody></mujoco>'
    )
    assert height_field_mesh(model) is None


def test_a_mesh_takes_any_height_field_by_its_geom() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><hfield name="h" nrow="2" ncol="3" size="1 2 .5 .1" elevation="0 0 0 0 1 0"/></asset>'
        '<worldbody><geom type="hfield" hfield="h"/></worldbody></mujoco>'
    )
    mesh = HeightFieldMesh(model, 0)
    corners = mesh._vertices.reshape(-1, 3)
    assert corners[:3].tolist() == [[-1, -2, 0], [0, -2, 0.5], [1, -2, 0]]
    np.testing.assert_array_equal(mesh._triangles[0, 1], [1, 2, 5, 1, 5, 4])


OPENGL_FIRST = """
import OpenGL.GL
import numpy as np
from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.camera.rasteriser import Rasteriser
from mpgrasp.geometry import looking_down
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import build_scene
scene = build_scene(SceneConfig(objects=("usb_stick",), cloth_unevenness=0.004), 3)
drawer = Rasteriser(scene.model, D435_INTRINSICS.centre_crop(350))
depth = drawer.render(scene.data(), looking_down([0.5, 0, 0.4]))
assert np.isfinite(depth).all()
"""


@needs_gl
def test_it_is_drawn_where_something_else_has_imported_pyopengl_before() -> None:
    free = {key: value for key, value in os.environ.items() if key != "PYOPENGL_PLATFORM"}
    ran = subprocess.run([sys.executable, "-c", OPENGL_FIRST], env=free, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
