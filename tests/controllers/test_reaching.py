"""Laws of reaching, for MP-PC and MVP alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_ticks import OBJECT, REACHING, THIN, blind_map, observe
from toy_views import Blob, fly

from mpgrasp.controllers import make_controller
from mpgrasp.controllers.config import MVP
from mpgrasp.geometry import line_angle_difference
from mpgrasp.robot.limits import Q_HOME, Q_MAX, Q_MIN


@pytest.mark.parametrize("name", REACHING)
@pytest.mark.parametrize(
    "blob", [OBJECT, replace(OBJECT, x=0.42, y=-0.1, angle=-1.2)], ids=["ahead", "behind"]
)
def test_the_camera_ends_above_an_object_in_view_and_the_grasp_is_on_it(name: str, blob: Blob) -> None:
    controller = make_controller(name)
    flight = fly(controller, blob, seed=2)
    assert np.hypot(*(flight.camera[-1] - [blob.x, blob.y])) < 0.01
    grasp = controller.final_grasp()
    assert grasp is not None
    assert np.hypot(*(grasp.position[:2] - [blob.x, blob.y])) < 0.006
    assert line_angle_difference(grasp.angle, blob.angle) < np.deg2rad(5.1)
    assert grasp.width == pytest.approx(blob.width, rel=0.01)


@pytest.mark.parametrize("name", REACHING)
def test_a_thin_object_that_shows_only_from_near_by_is_found_by_all_but_published_mvp(name: str) -> None:
    """Multi-view picking has drifted away before the object shows: the paper's argument."""
    controller = make_controller(name)
    found = 0
    for seed in range(4):
        fly(controller, THIN, seed=seed)
        grasp = controller.final_grasp()
        found += grasp is not None and float(np.hypot(*(grasp.position[:2] - [THIN.x, THIN.y]))) < 0.01
    assert (found >= 3) == (name != "mvp")


@pytest.mark.parametrize("name", ["mppc", "mppc_robust", "mvp_robust"])
def test_what_is_claimed_late_is_grasped_however_many_views_claimed_nothing_before(name: str) -> None:
    late = Blob(x=0.5, y=0.0, quality=lambda height: 0.6 if height < 0.35 else 0.0)
    controller = make_controller(name)
    for _ in range(60):
        controller.update(observe((0.43, 0.0, 0.4), late))
        assert controller.final_grasp() is None or name == "mppc"
    controller.update(observe((0.43, 0.0, 0.19), late))
    grasp = controller.final_grasp()
    assert grasp is not None
    assert np.hypot(*(grasp.position[:2] - [late.x, late.y])) < late.radius + 0.005  # and half a cell


@pytest.mark.parametrize("name", REACHING)
def test_as_long_as_nothing_is_found_the_best_quality_is_zero(name: str) -> None:
    controller = make_controller(name, replace(MVP, min_quality=1.0))
    controller.update(observe((0.43, 0.0, 0.4), OBJECT))
    assert controller.diagnostics()["best_quality"] == 0.0


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


@pytest.mark.parametrize("name", REACHING)
def test_the_reach_is_done_exactly_at_z_min(name: str) -> None:
    for height, done in ((0.2 + 1e-9, False), (0.2, True), (0.19, True)):
        controller = make_controller(name, replace(MVP, z_min=0.2))
        assert controller.update(observe((0.43, 0.0, height))).done is done


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


@pytest.mark.parametrize("name", REACHING)
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("angle", [-1.4, -0.3, 0.0, 0.3])
def test_where_the_arm_points_aside_the_hand_turns_no_further_than_joint_7_can(
    name: str, side: float, angle: float
) -> None:
    x, y, yaw = 0.4, 0.28 * side, 0.0
    bearing = float(np.arctan2(y, x))
    controller = make_controller(name)
    for _ in range(45):  # turned by the controller's rate alone
        twist = controller.update(observe((x, y, 0.4), replace(OBJECT, x=x, y=y, angle=angle), yaw)).twist
        yaw += 0.1 * float(twist[5])
    wrist = Q_HOME[6] + bearing - yaw  # the arm points to the tool, and the wrist turns the hand back
    assert Q_MIN[6] + 0.1 < wrist < Q_MAX[6] - 0.1
    # what the end of the range leaves for the grasp itself to turn is less than 15 degrees and half a bin
    assert line_angle_difference(yaw - np.pi / 2, angle) < np.deg2rad(21)
