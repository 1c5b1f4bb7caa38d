"""Laws of the grasp analysis, on solids whose grasps are known by construction."""

from __future__ import annotations

import numpy as np
import pytest
from height_maps import Solid, height_map

from mpgrasp.detectors.antipodal.analysis import WorldGrasps, antipodal_grasps, quality_along
from mpgrasp.detectors.antipodal.hand import HandGeometry
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import line_angle_difference

QUARTER = np.pi / 2


def best(grasps: WorldGrasps) -> tuple[float, float, float, float, float]:
    """x, y, angle, width, quality of the best grasp."""
    m = grasps.height_map
    row, col = np.unravel_index(np.argmax(grasps.quality), grasps.quality.shape)
    x, y = m.x0 + col * m.cell, m.y0 + row * m.cell
    angle, width, quality = (float(a[row, col]) for a in (grasps.angle, grasps.width, grasps.quality))
    return float(x), float(y), angle, width, quality


@pytest.mark.parametrize("yaw", np.linspace(-1.5, 1.5, 7))
def test_a_stick_is_grasped_across_its_short_side_at_its_middle(yaw: float) -> None:
    stick = Solid(x=0.53, y=0.04, yaw=yaw, length=0.10, breadth=0.02, height=0.02)
    x, y, angle, _, quality = best(antipodal_grasps(height_map(stick)))
    assert quality > 0.7
    assert line_angle_difference(angle, yaw + QUARTER) < np.deg2rad(5)
    assert np.hypot(x - 0.53, y - 0.04) < 0.006


@pytest.mark.parametrize("height", [0.0045, 0.008])
def test_thin_sticks_are_graspable(height: float) -> None:
    stick = Solid(x=0.5, y=0.0, yaw=0.4, length=0.056, breadth=0.018, height=height)
    assert best(antipodal_grasps(height_map(stick)))[4] > 0.6


def test_thinner_is_worse() -> None:
    qualities = [
        best(antipodal_grasps(height_map(Solid(x=0.5, y=0, yaw=0, length=0.06, breadth=0.02, height=h))))[4]
        for h in (0.001, 0.002, 0.003, 0.005, 0.009)
    ]
    assert qualities[0] == 0
    assert np.all(np.diff(qualities) > 0)


def test_what_is_wider_than_the_opening_has_no_grasp() -> None:
    slab = Solid(x=0.5, y=0.0, yaw=0.3, length=0.12, breadth=0.085, height=0.03)
    assert not antipodal_grasps(height_map(slab)).quality.any()


def test_a_slab_as_wide_as_the_hand_opens_is_left_and_one_a_little_narrower_is_taken() -> None:
    for breadth, graspable in ((0.068, True), (0.079, False)):
        slab = Solid(x=0.5, y=0.0, yaw=0.0, length=0.12, breadth=breadth, height=0.03)
        assert (best(antipodal_grasps(height_map(slab)))[4] > 0.2) == graspable


def test_two_boxes_closer_than_a_finger_are_not_grasped_between_them() -> None:
    # side by side along y with a gap of 10 mm, both too long to be grasped along x
    pair = [Solid(x=0.5, y=s * 0.025, yaw=0.0, length=0.15, breadth=0.04, height=0.03) for s in (-1, 1)]
    assert not antipodal_grasps(height_map(*pair)).quality.any()
    apart = [Solid(x=0.5, y=s * 0.060, yaw=0.0, length=0.15, breadth=0.04, height=0.03) for s in (-1, 1)]
    _, y, angle, _, quality = best(antipodal_grasps(height_map(*apart)))
    assert quality > 0.7
    assert abs(abs(y) - 0.060) < 0.005
    assert line_angle_difference(angle, QUARTER) < np.deg2rad(5)


def test_two_objects_are_never_grasped_as_one() -> None:
    # touching, 20 mm broad together
    pair = [Solid(x=0.5, y=s * 0.005, yaw=0.0, length=0.06, breadth=0.0099, height=0.02) for s in (-1, 1)]
    grasps = antipodal_grasps(height_map(*pair))
    across = line_angle_difference(grasps.angle, QUARTER) < np.deg2rad(30)
    assert not (grasps.quality * across).any()


def test_a_plane_has_no_grasp() -> None:
    grasps = antipodal_grasps(height_map())
    for array in (grasps.quality, grasps.angle, grasps.width):
        assert array.shape == grasps.height_map.height.shape
        assert not array.any()


@pytest.mark.parametrize("turn", [0.6, -1.1])
def test_rotating_the_scene_rotates_the_grasps(turn: float) -> None:
    def scene(phi: float) -> WorldGrasps:
        solids = []
        for x, y, yaw, breadth in ((0.03, -0.05, 0.2, 0.03), (-0.04, 0.05, 1.0, 0.015)):
            c, s = np.cos(phi), np.sin(phi)
            solids.append(
                Solid(
                    x=0.5 + c * x - s * y,
                    y=s * x + c * y,
                    yaw=yaw + phi,
                    length=0.08,
                    breadth=breadth,
                    height=0.02,
                )
            )
        return antipodal_grasps(height_map(*solids))

    for k in (1, 2):
        found = []
        for phi in (0.0, turn):
            grasps = scene(phi)
            grasps.quality[grasps.height_map.label != k] = 0
            found.append(best(grasps))
        (x0, y0, a0, w0, q0), (x1, y1, a1, w1, q1) = found
        c, s = np.cos(turn), np.sin(turn)
        expected = np.array([0.5 + c * (x0 - 0.5) - s * y0, s * (x0 - 0.5) + c * y0])
        assert np.hypot(*(expected - (x1, y1))) < 0.012
        assert line_angle_difference(a1, a0 + turn) < np.deg2rad(6)
        assert abs(w1 - w0) < 0.005
        assert abs(q1 - q0) < 0.15


def test_the_opening_covers_the_object_with_the_executions_margin() -> None:
    stick = Solid(x=0.5, y=0.0, yaw=0.0, length=0.10, breadth=0.03, height=0.02)
    hand = HandGeometry()
    width = best(antipodal_grasps(height_map(stick), hand))[3]
    assert 0.03 + 2 * hand.margin[0] - 0.003 <= width + hand.opening_margin <= hand.max_opening


def test_a_neighbour_too_tall_for_the_palm_forbids_the_grasp() -> None:
    low = Solid(x=0.5, y=0.0, yaw=0.0, length=0.12, breadth=0.02, height=0.02)
    for height, graspable in ((0.035, True), (0.065, False)):
        wall = Solid(x=0.5, y=0.085, yaw=0.0, length=0.25, breadth=0.05, height=height)
        grasps = antipodal_grasps(height_map(low, wall))
        middle = grasps.quality[(grasps.height_map.label == 1)]
        assert (middle.max() > 0.5) == graspable


def test_an_ellipsoid_is_grasped_through_its_middle() -> None:
    egg = Solid(x=0.48, y=-0.03, yaw=0.7, length=0.08, breadth=0.04, height=0.04, shape="ellipsoid")
    x, y, angle, _, quality = best(antipodal_grasps(height_map(egg)))
    assert quality > 0.7
    assert np.hypot(x - 0.48, y + 0.03) < 0.005
    assert line_angle_difference(angle, 0.7 + QUARTER) < np.deg2rad(5)


def test_what_lies_on_a_broad_slab_is_grasped_but_worth_less() -> None:
    slab = Solid(x=0.5, y=0.0, yaw=0.0, length=0.15, breadth=0.15, height=0.02)
    stick = Solid(x=0.5, y=0.0, yaw=0.0, length=0.08, breadth=0.02, height=0.04)
    on_slab = best(antipodal_grasps(height_map(slab, stick)))
    on_table = best(antipodal_grasps(height_map(stick)))
    assert 0.2 < on_slab[4] < on_table[4]
    assert line_angle_difference(on_slab[2], QUARTER) < np.deg2rad(5)


def test_the_cells_size_changes_little() -> None:
    stick = Solid(x=0.5, y=0.0, yaw=0.5, length=0.08, breadth=0.025, height=0.015)
    coarse, fine = (
        best(antipodal_grasps(height_map(stick, cell=cell, half_extent=0.1))) for cell in (0.002, 0.001)
    )
    assert abs(coarse[4] - fine[4]) < 0.15
    assert line_angle_difference(coarse[2], fine[2]) < np.deg2rad(4)


def test_along_one_direction_there_are_grasps_only_if_it_crosses_the_stick() -> None:
    stick = Solid(x=0.5, y=0.0, yaw=0.3, length=0.12, breadth=0.02, height=0.02)
    truth = height_map(stick)
    across, along = (quality_along(truth, 0.3 + turn) for turn in (QUARTER, 0.0))
    assert across.shape == truth.height.shape
    assert across.max() > 0.5
    assert not along.any()
    assert not quality_along(height_map(), 0.3).any()


def test_something_tall_far_away_changes_no_grasp() -> None:
    low = Solid(x=0.42, y=0.0, yaw=0.3, length=0.08, breadth=0.02, height=0.02)
    tower = Solid(x=0.62, y=0.1, yaw=0.0, length=0.02, breadth=0.02, height=0.035)
    alone, both = (antipodal_grasps(height_map(*solids)) for solids in ((low,), (low, tower)))
    both.quality[both.height_map.label != 1] = 0
    (x0, y0, a0, w0, q0), (x1, y1, a1, w1, q1) = best(alone), best(both)
    assert np.hypot(x1 - x0, y1 - y0) < 0.02  # the best places along the stick are nearly alike
    assert line_angle_difference(a1, a0) < np.deg2rad(4)
    assert abs(w1 - w0) < 0.003
    assert abs(q1 - q0) < 0.1


def test_bad_hands_are_refused() -> None:
    with pytest.raises(ConfigError, match="opening"):
        HandGeometry(max_contact_width=0.09)
    with pytest.raises(ConfigError, match="margins"):
        HandGeometry(margin=(0.01, 0.005))
    with pytest.raises(ConfigError, match="opening margin"):
        HandGeometry(opening_margin=0.02)


def test_labels_do_not_change_with_the_oracle_s_settings() -> None:
    solids = (
        Solid(x=0.5, y=0.0, yaw=0.3, length=0.06, breadth=0.018, height=0.003),
        Solid(x=0.56, y=0.08, yaw=1.1, length=0.05, breadth=0.03, height=0.04),
        Solid(x=0.42, y=-0.06, yaw=0.0, length=0.05, breadth=0.05, height=0.05, shape="egg"),
    )
    grasps = antipodal_grasps(height_map(*solids))
    # of the shards that the shipped networks were trained on
    sums = [float(np.sum(a, dtype=float)) for a in (grasps.quality, grasps.angle, grasps.width)]
    assert sums == pytest.approx([265.7903, -398.5705, 28.53332], rel=1e-4)
