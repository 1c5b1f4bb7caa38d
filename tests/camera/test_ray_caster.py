"""Rays cast all at once meet what MuJoCo's own rays, and geometry, say."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np
import pytest
from toy_world import POSES, SMALL, World, edges_of, toy_world

from mpgrasp.camera import height_field_rays
from mpgrasp.camera.convex_rays import solids
from mpgrasp.camera.ray_caster import RayCaster, cast_rays
from mpgrasp.geometry import FloatArray, look_at, looking_down, transform_points

STEEP = looking_down([0.02, 0.01, 0.2], 0.9)
GRAZING = look_at([0.45, 0.1, 0.05], [0, 0, 0])
ASIDE = look_at([0.5, -0.5, 0.3], [0.2, -0.2, 0.02])
INSIDE = look_at([0.0, 0.0, 0.035], [0.1, 0.1, 0.02])  # within the box
UNDER = look_at([0.1, 0.1, -0.08], [0.0, 0.0, 0.1], x_axis=(0, 1, 0))
OVER_THE_BALL = looking_down([0.1, 0.1, 0.075], 0.2)  # the near plane cuts it
OVER_THE_DRUM = looking_down([0.1, -0.1, 0.16], 0.2)


@pytest.fixture(scope="module")
def world() -> World:
    return toy_world()


@pytest.mark.parametrize("pose", [*POSES, STEEP, GRAZING, ASIDE, INSIDE, UNDER, OVER_THE_BALL, OVER_THE_DRUM])
@pytest.mark.parametrize("groups", [(0, 1, 2), (3,)])
def test_all_at_once_rays_meet_what_single_rays_of_mujoco_meet(
    world: World, pose: FloatArray, groups: tuple[int, ...]
) -> None:
    model, data = world
    quick = RayCaster(model, SMALL, geom_groups=groups).render(data, pose)
    single = cast_rays(model, data, SMALL, pose, groups).depth
    # a ray that touches an edge may fall on either side of it
    off_edges = ~edges_of(single)
    np.testing.assert_array_equal(np.isnan(quick)[off_edges], np.isnan(single)[off_edges])
    np.testing.assert_allclose(quick[off_edges], single[off_edges], atol=2e-6)
    assert np.mean(~np.isclose(quick, single, atol=2e-6, equal_nan=True)) < 2e-4


@pytest.mark.parametrize("height", [0.0, 0.002, 0.02, 0.2])
@pytest.mark.parametrize("euler", ["0 0 0", "20 -10 30", "-70 0 15"])
def test_a_height_field_of_any_pose_and_steepness_is_met_where_single_rays_meet_it(
    height: float, euler: str
) -> None:
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><hfield name="h" nrow="31" ncol="45" size=".2 .15 {height or 0.004} .01"/></asset>'
        f'<worldbody><geom type="hfield" hfield="h" pos=".03 -.02 .01" euler="{euler}"/></worldbody></mujoco>'
    )
    bumps = cv2.GaussianBlur(np.random.default_rng(1).random((31, 45)), (0, 0), 2)
    model.hfield_data[:] = ((bumps - bumps.min()) / np.ptp(bumps)).ravel() * (height > 0)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for pose in (POSES[0], GRAZING, UNDER):
        quick, single = RayCaster(model, SMALL).render(data, pose), cast_rays(model, data, SMALL, pose).depth
        wrong = ~np.isclose(quick, single, atol=2e-6, equal_nan=True)
        assert wrong.mean() < 2e-4, (pose, wrong.sum())


def test_rays_that_do_not_settle_on_a_triangle_in_time_are_cast_by_mujoco(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, data = world
    single = cast_rays(model, data, SMALL, POSES[2]).depth
    monkeypatch.setattr(height_field_rays, "_ROUNDS", 1)
    quick = RayCaster(model, SMALL).render(data, POSES[2])
    assert np.mean(~np.isclose(quick, single, atol=2e-6, equal_nan=True)) < 2e-4


def test_dents_holes_and_clear_materials_are_seen_as_mujoco_sees_them() -> None:
    tetrahedra = "0 0 0 .1 0 0 0 .1 0 0 0 .1"
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><material name="clear" rgba="1 1 1 0"/><material name="blue" rgba="0 0 1 1"/>'
        '<mesh name="dented" vertex="-.1 -.1 0 .1 -.1 0 .1 .1 0 -.1 .1 0 0 0 .03 0 0 .1" '
        'face="0 1 4 1 2 4 2 3 4 3 0 4 1 0 5 2 1 5 3 2 5 0 3 5"/>'
        f'<mesh name="convex" vertex="{tetrahedra}"/></asset><worldbody>'
        '<geom type="plane" size=".3 .2 .1" pos="0 0 -.1" euler="3 4 5"/>'
        '<geom type="sphere" size=".02" pos=".1 .1 .3" material="clear"/>'
        '<geom type="sphere" size=".02" pos="-.1 .1 .2" material="blue" rgba="1 0 0 0"/>'
        '<body pos=".1 -.1 0" euler="170 10 30"><freejoint/><geom type="mesh" mesh="dented" mass="1"/></body>'
        '<body pos="-.1 -.1 .1" euler="0 40 0"><freejoint/><geom type="mesh" mesh="convex"/></body>'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert [len(solids(model, geom)) for geom in range(model.ngeom)] == [0, 1, 1, 0, 1]
    for pose in (*POSES, UNDER, ASIDE):
        quick, single = RayCaster(model, SMALL).render(data, pose), cast_rays(model, data, SMALL, pose).depth
        wrong = ~np.isclose(quick, single, atol=2e-6, equal_nan=True)
        assert wrong.mean() < 2e-4, (pose, wrong.sum())


def test_rays_meet_a_box_where_geometry_says() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="box" size=".1 .08 .05" pos="0 0 .05"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    depth = RayCaster(model, SMALL).render(data, looking_down([0, 0, 0.4]))
    hits = np.isfinite(depth)
    np.testing.assert_allclose(depth[hits], 0.3, atol=1e-6)
    v, u = np.nonzero(hits)
    corners = transform_points(
        looking_down([0, 0, 0.4]), SMALL.deproject(u.astype(float), v.astype(float), np.full(len(u), 0.3))
    )
    np.testing.assert_allclose(np.abs(corners).max(axis=0)[:2], [0.1, 0.08], atol=0.3 / 130)


def test_rays_tell_geoms_and_normals() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="sphere" size=".1"/>'
        '<geom type="box" size=".1 .1 .1" pos="0.3013 0 0"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hits = cast_rays(model, data, SMALL, looking_down([0.1, 0, 0.6]))
    assert set(np.unique(hits.geom)) == {-1, 0, 1}
    np.testing.assert_array_equal(hits.geom < 0, np.isnan(hits.depth))
    v, u = np.nonzero(hits.geom == 0)
    points = transform_points(
        looking_down([0.1, 0, 0.6]), SMALL.deproject(u.astype(float), v.astype(float), hits.depth[v, u])
    )
    np.testing.assert_allclose(hits.normal[v, u], points / 0.1, atol=1e-4)
    top = (hits.geom == 1) & (hits.depth < 0.500001)
    np.testing.assert_allclose(hits.normal[top], np.broadcast_to([0, 0, 1], (top.sum(), 3)), atol=1e-9)
