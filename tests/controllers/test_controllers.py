"""One contract for every controller, then what tells them apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from controller_parts import MppcByMean
from toy_views import T_TCP_CAMERA, Blob, blob_map, flat_map, fly

from mpgrasp.controllers import CONTROLLERS, make_controller
from mpgrasp.controllers.config import PRESETS, MppcConfig, preset
from mpgrasp.controllers.controller import Command, Controller, Observation
from mpgrasp.controllers.grid_map import GridConfig
from mpgrasp.controllers.mppc import Mppc
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import GraspMap, peak_height

ALL = sorted(CONTROLLERS)
REACHING = ["mppc", "mvp"]
OBJECT = Blob(x=0.55, y=0.08)
NOTHING = Blob(x=0.5, y=0.0, quality=lambda height: 0.0)
THIN = Blob(x=0.53, y=0.05, quality=lambda height: 0.8 if height < 0.42 else 0.0)


def observe(
    position: tuple[float, float, float], view: Blob | GraspMap | float = OBJECT, yaw: float = 0.0
) -> Observation:
    """A tick at a tcp position: of a blob, of the same quality everywhere, or with the maps of `view`."""
    T_world_tcp = looking_down(position, yaw)
    T_world_camera = T_world_tcp @ T_TCP_CAMERA
    if isinstance(view, Blob):
        seen = blob_map(view, T_world_camera, None)
    elif isinstance(view, GraspMap):
        seen = replace(view, T_world_camera=T_world_camera)
    else:
        seen = flat_map(view, T_world_camera)
    return Observation(time=0.0, T_world_tcp=T_world_tcp, grasp_map=seen)


def blind_map() -> GraspMap:
    view = flat_map(0.0, looking_down([0.5, 0.0, 0.5]))
    return replace(view, depth=np.full_like(view.depth, np.nan))


def same(a: Command, b: Command) -> bool:
    return bool(np.array_equal(a.twist, b.twist)) and a.gripper == b.gripper and a.done == b.done


# --- the contract -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ALL)
def test_a_controller_is_called_by_its_name(name: str) -> None:
    assert make_controller(name).name == name


def test_an_unknown_controller_or_preset_is_named_with_what_would_have_worked() -> None:
    with pytest.raises(ConfigError, match="mppc, mvp, open_loop"):
        make_controller("teleport")
    with pytest.raises(ConfigError, match="paper, published"):
        preset("napkin")


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("blob", [NOTHING, THIN], ids=["nothing", "thin"])
@pytest.mark.parametrize("settings", sorted(PRESETS))
def test_every_command_is_finite_bounded_and_the_last_one_is_done_and_still(
    name: str, blob: Blob, settings: str
) -> None:
    config = PRESETS[settings]
    flight = fly(make_controller(name, config), blob, seed=1)
    for command in flight.commands:
        assert command.twist.shape == (6,)
        assert np.isfinite(command.twist).all()
        assert np.hypot(*command.twist[:2]) <= config.v_1 + 1e-9
        assert abs(command.twist[2]) <= config.v_z
        assert not command.twist[3:5].any()
        assert abs(command.twist[5]) <= config.yaw_rate_max
        assert command.gripper == config.gripper_open
    assert [c.done for c in flight.commands] == [False] * (len(flight.commands) - 1) + [True]
    assert not flight.commands[-1].twist.any()


@pytest.mark.parametrize("name", ALL)
def test_the_same_seed_gives_the_same_commands_and_seed_zero_is_a_seed(name: str) -> None:
    controller = make_controller(name)
    first, second = (fly(controller, NOTHING, seed=0) for _ in range(2))
    assert all(same(a, b) for a, b in zip(first.commands, second.commands, strict=True))


@pytest.mark.parametrize("name", ALL)
def test_reset_forgets_the_last_episode(name: str) -> None:
    controller = make_controller(name)
    fly(controller, OBJECT)
    assert controller.final_grasp() is not None
    controller.reset(0)
    assert controller.final_grasp() is None
    assert controller.diagnostics() == {}


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("view", [0.0, np.nan, blind_map()], ids=["empty", "nan", "blind"])
def test_a_map_that_says_nothing_yields_no_grasp_and_no_yaw(name: str, view: GraspMap | float) -> None:
    controller = make_controller(name)
    for height in (0.5, 0.3):
        command = controller.update(observe((0.4, 0.0, height), view))
        assert np.isfinite(command.twist).all()
        assert command.twist[5] == 0
    assert controller.final_grasp() is None


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize(
    "blob",
    [Blob(x=0.5, y=0.36, radius=0.008), Blob(x=0.155, y=0.0, radius=0.002)],
    ids=["beside", "before"],
)
def test_a_grasp_outside_of_the_workspace_is_never_taken(name: str, blob: Blob) -> None:
    controller = make_controller(name)
    grasps = []
    for _ in range(6):
        controller.update(observe((blob.x - 0.05, blob.y, 0.4), blob))
        grasps.append(controller.final_grasp())
    for grasp in grasps:
        assert grasp is None or max(abs(grasp.position[0] - 0.5), abs(grasp.position[1])) <= 0.34


@pytest.mark.parametrize("name", ALL)
def test_a_grasp_above_the_ceiling_or_below_the_table_is_never_taken(name: str) -> None:
    for surface in (0.2, -0.05):
        controller = make_controller(name)
        view = flat_map(0.9, looking_down([0.5, 0, 0.463]), surface=surface)
        controller.update(observe((0.43, 0.0, 0.4), view))
        assert controller.final_grasp() is None


@pytest.mark.parametrize("name", ALL)
def test_a_grasp_below_the_least_quality_is_not_attempted(name: str) -> None:
    weak = Blob(x=0.5, y=0.0, quality=lambda height: 0.25)
    for threshold, taken in ((0.1, True), (0.4, False)):
        controller = make_controller(name, MppcConfig(min_quality=threshold))
        for _ in range(4):
            controller.update(observe((0.43, 0.0, 0.4), weak))
        assert (controller.final_grasp() is not None) == taken


@pytest.mark.parametrize("name", ALL)
def test_a_remembered_failure_sends_the_next_attempt_elsewhere(name: str) -> None:
    better, worse = Blob(x=0.5, y=0.0), Blob(x=0.56, y=0.04, quality=lambda height: 0.8)
    controller: Any = make_controller(name)
    for attempt, expected in enumerate([better, worse]):
        controller.reset(attempt)
        if attempt:
            controller.remember_failure(np.array([better.x, better.y, 0.0]))
        for _ in range(4):
            one = observe((0.45, 0.0, 0.4), better)
            other = observe((0.45, 0.0, 0.4), worse)
            both = np.maximum(one.grasp_map.quality, other.grasp_map.quality)
            controller.update(replace(one, grasp_map=replace(one.grasp_map, quality=both)))
        grasp = controller.final_grasp()
        assert np.hypot(grasp.position[0] - expected.x, grasp.position[1] - expected.y) < 0.01


@pytest.mark.parametrize("name", ALL)
def test_diagnostics_are_grids_of_the_map_and_scalars(name: str) -> None:
    controller = make_controller(name)
    controller.update(observe((0.43, 0.0, 0.45)))
    entries = controller.diagnostics()
    assert {"mean_quality", "best_quality"} <= entries.keys()
    for entry in entries.values():
        assert isinstance(entry, bool | float) or np.shape(entry) == GridConfig().shape


# --- reaching -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", REACHING)
@pytest.mark.parametrize("settings", sorted(PRESETS))
@pytest.mark.parametrize(
    "blob", [OBJECT, replace(OBJECT, x=0.42, y=-0.1, angle=-1.2)], ids=["ahead", "behind"]
)
def test_the_camera_ends_above_an_object_in_view_and_the_grasp_is_on_it(
    name: str, settings: str, blob: Blob
) -> None:
    controller = make_controller(name, PRESETS[settings])
    flight = fly(controller, blob, seed=2)
    assert np.hypot(*(flight.camera[-1] - [blob.x, blob.y])) < 0.01
    grasp = controller.final_grasp()
    assert grasp is not None
    assert np.hypot(*(grasp.position[:2] - [blob.x, blob.y])) < 0.006
    assert line_angle_difference(grasp.angle, blob.angle) < np.deg2rad(5.1)
    assert grasp.width == pytest.approx(blob.width, rel=0.01)


@pytest.mark.parametrize("name", REACHING)
def test_a_thin_object_that_shows_only_from_near_by_is_grasped_when_it_comes_into_view(name: str) -> None:
    controller = make_controller(name)
    found = 0
    for seed in range(4):
        fly(controller, THIN, seed=seed)
        grasp = controller.final_grasp()
        found += grasp is not None and float(np.hypot(*(grasp.position[:2] - [THIN.x, THIN.y]))) < 0.01
    assert found >= 3


def test_with_nothing_in_view_mvp_drifts_away_and_mppc_hardly_does() -> None:
    """The failure that the paper is about, and its cure."""
    paths = {}
    for name in REACHING:
        flights = [fly(make_controller(name), NOTHING, seed=seed, noise=0.01) for seed in range(3)]
        paths[name] = np.mean([np.hypot(*np.diff(f.camera, axis=0).T).sum() for f in flights])
        drift = np.mean([np.hypot(*(f.camera[-1] - f.camera[0])) for f in flights])
        assert (drift > 0.2) if name == "mvp" else (drift < 0.14)
    # what alpha = 0.2 of 0.1 m/s lets through in 6.5 s
    assert paths["mppc"] <= 0.2 * 0.1 * 6.5 + 1e-6
    assert paths["mvp"] > 3.5 * paths["mppc"]


@pytest.mark.parametrize("name", REACHING)
def test_with_nothing_told_apart_the_seed_chooses_the_direction_and_it_is_kept(name: str) -> None:
    headings = []
    for seed in range(5):
        controller = make_controller(name)
        controller.reset(seed)
        position = np.array([0.43, 0.0, 0.5])
        directions = []
        for _ in range(8):
            twist = controller.update(observe((position[0], position[1], position[2]), blind_map())).twist
            directions.append(np.arctan2(twist[1], twist[0]))
            position += 0.1 * twist[:3]
        assert np.std(np.unwrap(directions)) < 0.1
        headings.append(directions[0])
    assert np.ptp(headings) > 1.0


@pytest.mark.parametrize("name", REACHING)
def test_beyond_the_border_the_arm_is_led_back_and_at_it_never_pushed_out(name: str) -> None:
    for x, y in [(0.90, 0.0), (0.5, 0.42), (0.12, -0.38)]:
        twist = make_controller(name).update(observe((x - 0.07, y, 0.4), 0.0)).twist
        inwards = np.array([0.5, 0.0]) - [x, y]
        outside = np.maximum(np.abs([x - 0.5, y]) - 0.34, 0) > 0
        assert (twist[:2][outside] * inwards[outside] > 0).all()
    # at the border itself the target is a cell of the grid, hence not outside
    twist = make_controller(name).update(observe((0.84 - 0.07, 0.0, 0.4), 0.0)).twist
    assert twist[0] <= 0


def test_without_a_peak_mppc_goes_sideways_at_exactly_alpha_and_mvp_does_not_care() -> None:
    dull = 0.3
    for alpha in (0.0, 0.2, 0.7):
        config = MppcConfig(alpha=alpha)
        mppc, mvp = (make_controller(n, config).update(observe((0.4, 0.1, 0.45), dull)) for n in REACHING)
        assert np.hypot(*mvp.twist[:2]) > 0.05
        np.testing.assert_allclose(mppc.twist[:2], alpha * mvp.twist[:2], rtol=1e-12)
        assert mppc.twist[2] == mvp.twist[2] == -config.v_z


def test_with_a_peak_mppc_moves_as_mvp_does() -> None:
    mppc, mvp = (make_controller(n).update(observe((0.4, 0.1, 0.45))) for n in REACHING)
    np.testing.assert_array_equal(mppc.twist[:3], mvp.twist[:3])


def test_a_peak_is_three_pixels_wide_and_not_one() -> None:
    quality = np.zeros((30, 40), np.float32)
    quality[12, 7] = 1.0
    assert peak_height(quality) == pytest.approx(1 / 9)
    quality[20:23, 30:33] = 0.6
    assert peak_height(quality) == pytest.approx(0.6)
    for height, exists in ((0.59, True), (0.61, False)):
        controller = make_controller("mppc", MppcConfig(peak_threshold=height))
        observation = observe((0.43, 0.0, 0.45), 0.0)
        observation.grasp_map.quality[50:53, 80:83] = 0.6
        controller.update(observation)
        assert controller.diagnostics()["peak"] is exists


@pytest.mark.parametrize("name", REACHING)
def test_the_reach_is_done_exactly_at_z_min(name: str) -> None:
    config = MppcConfig(z_min=0.2)
    for height, done in ((0.2 + 1e-9, False), (0.2, True), (0.19, True)):
        assert make_controller(name, config).update(observe((0.43, 0.0, height))).done is done


@pytest.mark.parametrize("name", REACHING)
@pytest.mark.parametrize("angle", [-1.4, -0.6, 0.0, 0.9, 1.5])
def test_the_hand_turns_to_the_grasp_and_stays_within_its_yaw_range(name: str, angle: float) -> None:
    controller = make_controller(name)
    flight = fly(controller, replace(OBJECT, angle=angle))
    T = flight.T_world_tcp
    closing = np.arctan2(T[1, 1], T[0, 1])
    assert line_angle_difference(closing, angle) < np.deg2rad(12)
    assert abs(np.arctan2(T[1, 0], T[0, 0])) <= np.pi / 2 + 1e-9


@pytest.mark.parametrize("name", REACHING)
@pytest.mark.parametrize("yaw", [-1.2, 0.3, 1.4])
def test_the_hand_turns_the_shorter_way(name: str, yaw: float) -> None:
    for turn in (-0.8, -0.1, 0.1, 0.8):
        if abs(yaw + turn) > np.pi / 2:
            continue
        closing = yaw - np.pi / 2
        view = replace(OBJECT, angle=closing + turn)
        twist = make_controller(name).update(observe((0.45, 0.0, 0.4), view, yaw)).twist
        # the grid knows angles to half a bin of ten degrees
        assert twist[5] == pytest.approx(np.clip(turn, -0.5, 0.5), abs=0.09)


def test_mppc_takes_the_best_grasp_of_all_views_and_empties_its_pool_on_reset() -> None:
    controller = Mppc()
    qualities = [0.3, 0.85, 0.6]
    for quality in qualities:
        controller.update(observe((0.43, 0.0, 0.4), Blob(x=0.5, y=0.0, quality=lambda height, q=quality: q)))  # type: ignore[misc]
    assert len(controller.pool) == 3
    grasp = controller.final_grasp()
    assert grasp is not None
    assert grasp.quality == pytest.approx(0.85, abs=0.01)
    controller.reset(0)
    assert controller.pool == []


def test_of_equally_good_grasps_mppc_takes_the_one_seen_last() -> None:
    controller = Mppc()
    for x in (0.48, 0.52):
        observation = observe((0.43, 0.0, 0.4), Blob(x=x, y=0.0))
        quality = observation.grasp_map.quality
        quality[:] = quality > 0.7
        controller.update(observation)
    grasp = controller.final_grasp()
    assert grasp is not None
    assert grasp.quality == 1.0
    assert abs(controller.pool[0].position[0] - controller.pool[1].position[0]) > 0.02
    assert grasp is controller.pool[1]


def test_mvp_trusts_many_views_over_the_best_one() -> None:
    flicker, steady = Blob(x=0.55, y=0.05, quality=lambda height: 1.0), Blob(x=0.48, y=-0.03)
    grasps: dict[str, FloatArray] = {}
    for name in REACHING:
        controller = make_controller(name)
        for tick in range(12):
            controller.update(observe((0.43, 0.0, 0.4), flicker if tick == 3 else steady))
        grasp = controller.final_grasp()
        assert grasp is not None
        grasps[name] = grasp.position[:2]
    assert np.hypot(*(grasps["mvp"] - [steady.x, steady.y])) < 0.006
    assert np.hypot(*(grasps["mppc"] - [flicker.x, flicker.y])) < 0.006


def test_mppc_by_mean_grasps_as_mvp_does_and_goes_sideways_as_mppc_does() -> None:
    flicker, steady = Blob(x=0.55, y=0.05, quality=lambda height: 1.0), Blob(x=0.48, y=-0.03)
    hybrid, mvp, mppc = MppcByMean(), make_controller("mvp"), make_controller("mppc")
    views: list[Blob | float] = [0.3, *(flicker if tick == 3 else steady for tick in range(12))]
    for view in views:
        ours, full, slow = (c.update(observe((0.43, 0.0, 0.4), view)) for c in (hybrid, mvp, mppc))
        assert same(ours, full) == (view != 0.3)
        np.testing.assert_array_equal(ours.twist[:3], slow.twist[:3])
    one, other = hybrid.final_grasp(), mvp.final_grasp()
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.position, other.position)
    assert (one.angle, one.width, one.quality) == (other.angle, other.width, other.quality)


def test_open_loop_takes_the_best_pixel_of_its_first_view_and_looks_no_further() -> None:
    controller: Controller = make_controller("open_loop")
    assert controller.update(observe((0.43, 0.0, 0.5), OBJECT)).done
    controller.update(observe((0.43, 0.0, 0.5), Blob(x=0.45, y=-0.05, quality=lambda height: 1.0)))
    grasp = controller.final_grasp()
    assert grasp is not None
    assert np.hypot(*(grasp.position[:2] - [OBJECT.x, OBJECT.y])) < 0.002


@pytest.mark.parametrize(
    "settings",
    [
        {"v_z": 0.0},
        {"v_1": -0.1},
        {"alpha": 1.5},
        {"gamma": np.nan},
        {"z_min": 0.6},
        {"border": "torus"},
        {"yaw_range": 0.5},
        {"peak_threshold": -0.1},
        {"window": 0.0},
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict) -> None:
    with pytest.raises(ConfigError):
        MppcConfig(**settings)


def test_the_defaults_are_those_of_table_one() -> None:
    c = MppcConfig()
    assert (c.grid.cell, c.grid.extent, c.grid.n_quality, c.grid.n_angle) == (0.005, 0.68, 10, 18)
    assert (c.v_z, c.alpha, c.z_max, c.z_min) == (0.05, 0.2, 0.50, 0.175)
