"""Laws of grasps in the image and in the world."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpgrasp.depth import CameraIntrinsics
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import line_angle_difference, looking_down
from mpgrasp.grasp import (
    Grasp,
    GraspMap,
    GraspRectangle,
    best_pixel,
    image_to_world_angle,
    peak_height,
    peaks,
    world_to_image_angle,
)

YAWS = [0.0, 0.7, -2.1]
WIDE = CameraIntrinsics(fx=210.0, fy=230.0, cx=70.0, cy=40.0, width=131, height=97)


def random_map(yaw: float, rng: np.random.Generator) -> GraspMap:
    shape = (WIDE.height, WIDE.width)

    def draw(low: float, high: float) -> np.ndarray:
        return rng.uniform(low, high, shape).astype(np.float32)

    return GraspMap(
        quality=draw(0, 1),
        angle=draw(-np.pi / 2, np.pi / 2),
        width=draw(5, 60),
        depth=draw(0.25, 0.6),
        intrinsics=WIDE,
        T_world_camera=looking_down([0.5, -0.1, 0.6], yaw),
    )


@pytest.mark.parametrize("yaw", YAWS)
def test_image_angle_agrees_with_two_points_along_the_closing_direction(yaw: float) -> None:
    """Oracle: deproject two pixels that lie on the line and take the heading between them."""
    T = looking_down([0.4, 0.2, 0.5], yaw)
    for angle in np.linspace(-np.pi / 2, np.pi / 2, 11):
        pixels = np.array([[0.0, 0.0], [np.cos(angle), -np.sin(angle)]]) * 30 + [60, 50]
        square = CameraIntrinsics(fx=200, fy=200, cx=64, cy=48, width=128, height=96)
        points = square.deproject(pixels[:, 0], pixels[:, 1], np.full(2, 0.5)) @ T[:3, :3].T
        dx, dy, _ = points[1] - points[0]
        assert line_angle_difference(image_to_world_angle(angle, T), np.arctan2(dy, dx)) < 1e-9


@pytest.mark.parametrize("yaw", YAWS)
def test_turning_the_camera_turns_the_world_angle_by_as_much(yaw: float) -> None:
    straight = image_to_world_angle(0.3, looking_down([0, 0, 1]))
    turned = image_to_world_angle(0.3, looking_down([0, 0, 1], yaw))
    assert line_angle_difference(turned, straight + yaw) < 1e-9


@pytest.mark.parametrize("yaw", YAWS)
def test_mirroring_the_image_angle_mirrors_the_world_angle_about_the_camera_heading(yaw: float) -> None:
    T = looking_down([0, 0, 1], yaw)
    for angle in (0.2, 0.9, -1.3):
        left, right = image_to_world_angle(angle, T), image_to_world_angle(-angle, T)
        assert line_angle_difference((left - yaw), -(right - yaw)) < 1e-9


@pytest.mark.parametrize("yaw", YAWS)
def test_world_angle_to_image_and_back_is_the_same_line(yaw: float) -> None:
    T = looking_down([0.1, 0.2, 0.4], yaw)
    angles = np.linspace(-1.5, 1.5, 23)
    assert (
        line_angle_difference(image_to_world_angle(world_to_image_angle(angles, T), T), angles).max() < 1e-9
    )


@pytest.mark.parametrize("yaw", YAWS)
def test_the_rectangle_of_a_pixel_s_grasp_is_what_the_maps_say_there(yaw: float) -> None:
    view = random_map(yaw, np.random.default_rng(0))
    for row, col in [(0, 0), (96, 130), (13, 101), (70, 5)]:
        rectangle = view.rectangle_of(view.grasp_at(row, col))
        assert (rectangle.u, rectangle.v) == pytest.approx((col, row), abs=1e-6)
        assert line_angle_difference(rectangle.angle, float(view.angle[row, col])) < 1e-9
        assert rectangle.width_px == pytest.approx(float(view.width[row, col]))


@pytest.mark.parametrize("yaw", YAWS)
def test_the_grasp_of_a_pixel_agrees_with_the_maps_of_the_whole_image(yaw: float) -> None:
    view = random_map(yaw, np.random.default_rng(1))
    points, widths = view.world_points(), view.world_width()
    angles = image_to_world_angle(view.angle, view.T_world_camera)
    for row, col in [(0, 130), (50, 60), (96, 0)]:
        grasp = view.grasp_at(row, col)
        np.testing.assert_allclose(grasp.position, points[row, col], atol=1e-6)
        assert line_angle_difference(grasp.angle, angles[row, col]) < 1e-5
        assert grasp.width == pytest.approx(widths[row, col], rel=1e-5)


def test_the_grasp_frame_closes_along_the_grasp_angle_and_approaches_downwards() -> None:
    for angle in (-1.2, 0.0, 0.4):
        T = Grasp(position=np.array([0.4, 0.1, 0.02]), angle=angle, width=0.05, quality=1).T_world_grasp()
        np.testing.assert_allclose(T[:3, 1], [np.cos(angle), np.sin(angle), 0], atol=1e-12)
        np.testing.assert_allclose(T[:3, 2], [0, 0, -1], atol=1e-12)
        np.testing.assert_allclose(np.cross(T[:3, 1], T[:3, 2]), T[:3, 0], atol=1e-12)


@pytest.mark.parametrize("wrong", [np.s_[:-1], np.s_[:, :-1], np.s_[None]], ids=["rows", "columns", "axes"])
def test_a_map_of_the_wrong_size_is_refused(wrong: Any) -> None:
    view = random_map(0.0, np.random.default_rng(2))
    for quality in (view.quality.T, view.quality[wrong]):
        refused_map(view, quality)


def refused_map(view: GraspMap, quality: Any) -> None:
    with pytest.raises(ConfigError, match="quality"):
        GraspMap(
            quality=quality,
            angle=view.angle,
            width=view.width,
            depth=view.depth,
            intrinsics=WIDE,
            T_world_camera=view.T_world_camera,
        )


def test_rectangles_have_the_nominal_jaw_and_not_the_pads_width() -> None:
    grasps = random_map(0.3, np.random.default_rng(4))
    grasp = grasps.grasp_at(40, 60)
    rectangle = grasps.rectangle_of(grasp)
    assert rectangle.jaw_px / rectangle.width_px == pytest.approx(0.02 / grasp.width)


def test_the_corners_span_a_rectangle_of_that_centre_size_and_direction() -> None:
    for angle in (-1.5, -0.3, 0.0, 1.2):
        corners = GraspRectangle(u=40, v=-3, angle=angle, width_px=30, jaw_px=11).corners()
        first, side = corners[1] - corners[0], corners[2] - corners[1]
        np.testing.assert_allclose(corners.mean(axis=0), [40, -3])
        assert (np.hypot(*first), np.hypot(*side)) == pytest.approx((30, 11))
        assert first @ side == pytest.approx(0.0, abs=1e-9)
        assert line_angle_difference(np.arctan2(-first[1], first[0]), angle) < 1e-9


def test_rectangle_tilts_counter_clockwise_on_screen() -> None:
    first, second, *_ = GraspRectangle(u=0, v=0, angle=np.pi / 4, width_px=10, jaw_px=2).corners()
    du, dv = second - first
    assert du > 0
    assert dv < 0  # up on screen


def test_iou_agrees_with_counting_points() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-30, 30, (200_000, 2))

    def inside(r: GraspRectangle) -> np.ndarray:
        d = points - [r.u, r.v]
        along = d @ [np.cos(r.angle), -np.sin(r.angle)]
        across = d @ [np.sin(r.angle), np.cos(r.angle)]
        return (abs(along) < r.width_px / 2) & (abs(across) < r.jaw_px / 2)

    for _ in range(5):
        a, b = (
            GraspRectangle(
                u=rng.uniform(-5, 5),
                v=rng.uniform(-5, 5),
                angle=rng.uniform(-1.5, 1.5),
                width_px=rng.uniform(10, 25),
                jaw_px=rng.uniform(5, 15),
            )
            for _ in range(2)
        )
        expected = (inside(a) & inside(b)).sum() / (inside(a) | inside(b)).sum()
        assert a.iou(b) == pytest.approx(expected, abs=0.02)
        assert a.iou(b) == pytest.approx(b.iou(a), abs=1e-5)


def test_iou_is_one_with_itself_after_half_a_turn_and_zero_apart_or_without_area() -> None:
    a = GraspRectangle(u=1000, v=2000, angle=0.4, width_px=20, jaw_px=8)
    turned = replace(a, angle=a.angle - np.pi)
    assert a.iou(turned) == pytest.approx(1, abs=1e-4)
    assert a.iou(GraspRectangle(u=1100, v=2000, angle=0.4, width_px=20, jaw_px=8)) == 0
    assert a.iou(GraspRectangle(u=1000, v=2000, angle=0.4, width_px=20, jaw_px=0)) == 0


def test_best_pixel_is_the_argmax_and_the_middle_of_a_flat_top() -> None:
    rng = np.random.default_rng(4)
    quality = rng.random((40, 61)).astype(np.float32)
    assert best_pixel(quality) == divmod(int(np.argmax(quality)), 61)
    quality[10:21, 30:51] = 1.0
    assert best_pixel(quality)[0] == 15
    quality[15, 40] = np.nan
    assert best_pixel(quality) != (15, 40)


def test_peaks_find_every_bump_once_best_first() -> None:
    v, u = np.mgrid[:90, :130]
    bumps = [(20, 30, 0.9), (70, 100, 0.6), (40, 110, 0.75), (60, 20, 0.05)]
    quality = sum(q * np.exp(-((v - r) ** 2 + (u - c) ** 2) / 50) for r, c, q in bumps)
    assert peaks(quality, threshold=0.1, distance=8).tolist() == [[20, 30], [40, 110], [70, 100]]
    assert peaks(quality, threshold=0.1, distance=8, count=1).tolist() == [[20, 30]]
    assert peaks(quality, threshold=0.1, distance=60).tolist() == [[20, 30], [40, 110]]


def test_peaks_come_best_first_whatever_row_they_lie_in_and_never_at_a_hole() -> None:
    quality = np.zeros((60, 80))
    heights = {(10, 70): 0.3, (20, 10): 0.9, (30, 50): 0.5, (50, 30): 0.7}
    for place, height in heights.items():
        quality[place] = height
    quality[40, 70] = np.nan
    expected = sorted(heights, key=lambda place: -heights[place])
    assert [tuple(place) for place in peaks(quality, threshold=0.1, distance=5)] == expected


def test_a_hole_is_no_peak_and_hides_none() -> None:
    quality = np.zeros((20, 30))
    quality[5:8, 5:8] = 0.6
    quality[15, 20] = np.nan
    assert peak_height(quality) == pytest.approx(0.6)


def test_peaks_of_an_empty_map_are_none_and_of_a_flat_top_are_one() -> None:
    assert peaks(np.zeros((20, 30))).shape == (0, 2)
    flat = np.zeros((40, 40))
    flat[10:15, 10:15] = 1
    assert len(peaks(flat, distance=10)) == 1


def test_a_map_whose_camera_has_no_pose_is_refused() -> None:
    with pytest.raises(ConfigError, match="grasp map's T_world_camera is no rigid transform"):
        replace(random_map(0.0, np.random.default_rng(2)), T_world_camera=np.zeros((4, 4)))
