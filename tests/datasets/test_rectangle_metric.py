"""Laws of the rectangle metric, against clipping of polygons that is written here."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection

from mpgrasp.datasets.rectangle_metric import MAX_ANGLE, agree, best_iou, right
from mpgrasp.grasp import GraspRectangle

Point = tuple[float, float]


def area(polygon: list[Point]) -> float:
    pairs = zip(polygon, polygon[1:] + polygon[:1], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2


def clipped(polygon: list[Point], by: list[Point]) -> list[Point]:
    """Sutherland and Hodgman's clipping of a polygon by a convex one, both in the same sense of turn."""
    result = polygon
    for (ax, ay), (bx, by_) in zip(by, by[1:] + by[:1], strict=True):

        def side(p: Point, ax: float = ax, ay: float = ay, bx: float = bx, by_: float = by_) -> float:
            return (bx - ax) * (p[1] - ay) - (by_ - ay) * (p[0] - ax)

        inside, result = result, []
        for p, q in zip(inside, inside[1:] + inside[:1], strict=True):
            s, t = side(p), side(q)
            if s >= 0:
                result.append(p)
            if s * t < 0:
                share = s / (s - t)
                result.append((p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])))
        if not result:
            return []
    return result


def points(rectangle: GraspRectangle) -> list[Point]:
    return [(float(u), float(v)) for u, v in rectangle.corners()]


def drawn(rng: np.random.Generator) -> GraspRectangle:
    return GraspRectangle(
        u=rng.uniform(0, 60), v=rng.uniform(0, 60), angle=rng.uniform(-np.pi / 2, np.pi / 2),
        width_px=rng.uniform(5, 80), jaw_px=rng.uniform(5, 40),
    )  # fmt: skip


def test_overlap_is_that_of_the_polygons_for_ten_thousand_pairs() -> None:
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(10_000):
        a, b = drawn(rng), drawn(rng)
        shared = area(clipped(points(a), points(b)))
        expected = shared / (a.width_px * a.jaw_px + b.width_px * b.jaw_px - shared)
        worst = max(worst, abs(a.iou(b) - expected))
    assert worst < 1e-9


def test_overlap_is_that_of_qhull() -> None:
    rng, tried = np.random.default_rng(1), 0
    while tried < 300:
        a, b = drawn(rng), drawn(rng)
        common = clipped(points(a), points(b))
        if area(common) < 1.0:
            continue
        inside = np.mean(common, axis=0)
        equations = np.vstack([ConvexHull(r.corners()).equations for r in (a, b)])
        shared = ConvexHull(HalfspaceIntersection(equations, inside).intersections).volume
        expected = shared / (a.width_px * a.jaw_px + b.width_px * b.jaw_px - shared)
        assert a.iou(b) == pytest.approx(expected, abs=1e-6)
        assert b.iou(a) == pytest.approx(a.iou(b), abs=1e-12)
        tried += 1


BASE = GraspRectangle(u=100.0, v=100.0, angle=0.2, width_px=60.0, jaw_px=30.0)


@pytest.mark.parametrize(("degrees", "fits"), [(0, True), (29, True), (31, False), (180, True), (151, True)])
def test_a_grasp_agrees_by_less_than_30_degrees_and_half_a_turn_is_none(degrees: float, fits: bool) -> None:
    square = replace(BASE, jaw_px=60.0)
    assert agree(replace(square, angle=square.angle + np.deg2rad(degrees)), square) is fits


@pytest.mark.parametrize(("share", "fits"), [(0.0, True), (0.55, True), (0.65, False)])
def test_a_grasp_agrees_by_more_than_a_quarter_of_overlap(share: float, fits: bool) -> None:
    along = np.array([np.cos(BASE.angle), -np.sin(BASE.angle)]) * share * BASE.width_px
    # moved by s of its length, two rectangles share (1 - s) / (1 + s): a quarter at s = 0.6
    moved = replace(BASE, u=BASE.u + float(along[0]), v=BASE.v + float(along[1]))
    assert agree(moved, BASE) is fits


def test_what_has_no_area_or_is_not_finite_agrees_with_nothing() -> None:
    for change in ({"width_px": 0.0}, {"jaw_px": -1.0}, {"u": float("nan")}, {"angle": float("inf")}):
        assert not agree(replace(BASE, **change), BASE)


def test_one_right_grasp_of_several_is_enough_and_far_labels_change_nothing() -> None:
    far = [replace(BASE, u=BASE.u + 500), replace(BASE, v=BASE.v - 500)]
    assert right([far[0], BASE], [BASE])
    assert not right(far, [BASE])
    assert right([BASE], [*far, BASE])
    assert best_iou(BASE, [*far, BASE]) == pytest.approx(1.0, abs=1e-4)
    assert best_iou(BASE, [replace(BASE, angle=BASE.angle + 2 * MAX_ANGLE)]) == 0.0


def test_a_thousand_images_are_scored_in_seconds() -> None:
    rng = np.random.default_rng(1)
    labels = [[drawn(rng) for _ in range(30)] for _ in range(50)]
    found = [[drawn(rng) for _ in range(5)] for _ in range(50)]
    clock = time.process_time()
    for grasps, of_image in zip(found, labels, strict=True):
        right(grasps, of_image)
        best_iou(grasps[0], of_image)
    assert 20 * (time.process_time() - clock) < 10.0
