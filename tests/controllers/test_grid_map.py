"""Laws of the grid map: what is counted where, and which cell is the best."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from toy_views import Blob, blob_map, flat_map

from mpgrasp.controllers.grid_map import EXTENT_PUBLISHED, ROBUST_GRID, GridConfig, GridMap
from mpgrasp.controllers.information import grid_entropy
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import line_angle_difference, looking_down, wrap_half_pi
from mpgrasp.grasp import GraspMap, image_to_world_angle

SMALL = GridConfig(extent=0.1, cell=0.02)
ROBUST = replace(ROBUST_GRID, extent=0.1, cell=0.02)
WIDE = CameraIntrinsics(fx=90.0, fy=80.0, cx=40.0, cy=20.0, width=83, height=47)


def cell_at(grid: GridMap, x: float, y: float) -> tuple[int, int]:
    """The cell whose centre, on the axes, is nearest to a world position."""
    xs, ys = grid.axes()
    return int(np.abs(ys - y).argmin()), int(np.abs(xs - x).argmin())


def random_map(yaw: float, seed: int) -> GraspMap:
    rng = np.random.default_rng(seed)
    shape = (WIDE.height, WIDE.width)
    depth = rng.uniform(0.3, 0.55, shape)
    depth[rng.random(shape) < 0.1] = np.nan
    return GraspMap(
        quality=rng.random(shape).astype(np.float32),
        angle=rng.uniform(-np.pi / 2, np.pi / 2, shape).astype(np.float32),
        width=rng.uniform(5, 60, shape).astype(np.float32),
        depth=depth.astype(np.float32),
        intrinsics=WIDE,
        T_world_camera=looking_down([0.52, 0.01, 0.5], yaw),
    )


def one_point(quality: float, angle: float, xy: tuple[float, float], z: float = 0.0) -> GraspMap:
    """A view of a single pixel, straight below the camera."""
    k = CameraIntrinsics(fx=100, fy=100, cx=0, cy=0, width=1, height=1)

    def pixel(value: float) -> np.ndarray:
        return np.full((1, 1), value, np.float32)

    return GraspMap(
        quality=pixel(quality),
        angle=pixel(angle),
        width=pixel(10),
        depth=pixel(0.5 - z),
        intrinsics=k,
        T_world_camera=looking_down([*xy, 0.5]),
    )


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.1])
def test_histograms_agree_with_counting_pixel_by_pixel(yaw: float) -> None:
    """Oracle: the geometry of GraspMap and a loop."""
    grid, view = GridMap(SMALL), random_map(yaw, 0)
    grid.update(view)
    expected = np.zeros_like(grid.counts)
    points = view.world_points()
    angles = wrap_half_pi(image_to_world_angle(view.angle, view.T_world_camera))
    for row, col in np.ndindex(view.depth.shape):
        x, y, z = points[row, col]
        if np.isfinite(z) and abs(x - 0.5) < 0.05 and abs(y) < 0.05 and -0.01 <= z <= 0.17:
            cell = int((y + 0.05) / 0.02), int((x - 0.45) / 0.02)
            angle_bin = int((angles[row, col] + np.pi / 2) / np.pi * 18)
            expected[(*cell, angle_bin % 18, int(view.quality[row, col] * 10))] += 1
    # single precision may move a point that lies on an edge between two bins
    assert np.abs(grid.counts - expected).sum() <= 0.01 * expected.sum()
    assert grid.counts.sum() == pytest.approx(expected.sum(), rel=0.01)
    np.testing.assert_array_equal(grid.counts.sum(axis=2), grid.quality_counts)


@pytest.mark.parametrize("config", [SMALL, ROBUST])
def test_a_map_that_is_asked_after_every_view_knows_what_one_asked_at_the_end_knows(
    config: GridConfig,
) -> None:
    asked, silent = GridMap(config), GridMap(config)
    entropy = None
    for seed in range(4):
        view = random_map(0.4 * seed, seed)
        for grid in (asked, silent):
            grid.update(view)
            if seed == 2:
                grid.suppress(np.array([0.5, 0.01]))
        assert set(asked.touched.tolist()) == set(asked.update(view).ravel().tolist()) - {-1}
        silent.update(view)
        asked.best_cell()
        entropy = grid_entropy(asked, entropy)
    np.testing.assert_array_equal(asked.observations(), asked.quality_counts.sum(axis=2))
    np.testing.assert_array_equal(asked.observations(), silent.observations())
    np.testing.assert_array_equal(asked.mean_quality(), silent.mean_quality())
    np.testing.assert_array_equal(entropy, grid_entropy(silent))


def test_mean_quality_of_a_robust_cell_is_the_mean_of_bin_centres() -> None:
    grid = GridMap(ROBUST)
    for quality in (0.12, 0.18, 0.55, 0.999, 1.0):
        grid.update(one_point(quality, 0.0, (0.5, 0.0)))
    cell = cell_at(grid, 0.5, 0.0)
    assert grid.mean_quality()[cell] == pytest.approx(np.mean([0.15, 0.15, 0.55, 0.95, 0.95]))
    assert grid.observations()[cell] == 5
    assert grid.mean_quality().sum() == pytest.approx(grid.mean_quality()[cell])


def test_the_mean_angle_of_any_direction_is_it_and_of_two_lies_halfway() -> None:
    for angle in np.linspace(-1.5, 1.5, 13):
        grid = GridMap(SMALL)
        for off in (0.0, 0.4, 0.2):  # the first alone, then with another, then with the one between them
            grid.update(one_point(0.9, float(wrap_half_pi(angle + off)), (0.5, 0.0)))
            cell = cell_at(grid, 0.5, 0.0)
            middle = angle if off == 0.0 else angle + 0.2
            # half a bin of 10 degrees at most for each
            assert line_angle_difference(grid.mean_angle(cell), middle) < np.deg2rad(5.01)


def test_the_mean_angle_across_the_wrap_is_the_wrap_and_not_zero() -> None:
    grid = GridMap(SMALL)
    for angle in np.deg2rad([-84, 84, -89, 89]):
        grid.update(one_point(0.9, angle, (0.5, 0.0)))
    cell = cell_at(grid, 0.5, 0.0)
    assert line_angle_difference(grid.mean_angle(cell), np.pi / 2) < 1e-6


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_the_best_grasp_recovers_what_every_view_agrees_on(yaw: float) -> None:
    grid, blob = GridMap(ROBUST_GRID), Blob(x=0.5375, y=0.0425, angle=-1.1, width=0.035)
    rng = np.random.default_rng(1)
    for height in np.linspace(0.5, 0.3, 6):
        grid.update(blob_map(blob, looking_down([0.52, 0.02, height], yaw), rng))
    grasp = grid.best_grasp()
    assert grasp is not None
    assert np.abs(grasp.position[:2] - [blob.x, blob.y]).max() < 1.01 * 0.005
    assert abs(grasp.position[2]) < 1e-3
    assert line_angle_difference(grasp.angle, blob.angle) < np.deg2rad(5.1)  # half a bin
    assert grasp.width == pytest.approx(0.035, rel=1e-3)
    assert grasp.quality > 0.7


def test_width_and_height_are_those_of_the_graspable_points_of_a_robust_cell() -> None:
    grid = GridMap(ROBUST)
    grid.update(one_point(0.0, 0.0, (0.5, 0.0), z=0.0))
    grid.update(one_point(0.8, 0.0, (0.5, 0.0), z=0.05))
    cell = cell_at(grid, 0.5, 0.0)
    assert grid.mean_height(cell) == pytest.approx(0.05, abs=1e-6)
    assert grid.mean_width(cell) == pytest.approx(10 * 0.45 / 100, rel=1e-5)


def test_points_outside_of_the_grid_are_dropped_and_not_put_onto_its_border() -> None:
    grid = GridMap(SMALL)
    for xy in [(0.45 - 1e-3, 0.0), (0.55 + 1e-3, 0.0), (0.5, 0.051), (0.5, -0.051), (5.0, 0.0)]:
        assert (grid.update(one_point(0.9, 0.0, xy)) == -1).all()
    assert grid.counts.sum() == 0
    assert (grid.update(one_point(0.9, 0.0, (0.549, -0.049))) == 4).all()


def test_noise_above_the_ceiling_and_below_the_floor_is_dropped() -> None:
    grid = GridMap(SMALL)
    for z in (0.171, -0.011, np.nan):
        assert (grid.update(one_point(0.9, 0.0, (0.5, 0.0), z=z)) == -1).all()
    assert grid.counts.sum() == 0
    grid.update(one_point(0.9, 0.0, (0.5, 0.0), z=0.169))
    assert grid.counts.sum() == 1


def test_quality_outside_of_zero_to_one_falls_into_the_end_bins_and_nan_is_dropped() -> None:
    grid = GridMap(SMALL)
    for quality in (-0.2, 1.3, np.nan):
        grid.update(one_point(quality, 0.0, (0.5, 0.0)))
    assert grid.quality_counts.sum(axis=(0, 1)).tolist() == [1, 0, 0, 0, 0, 0, 0, 0, 0, 1]


def test_width_and_height_of_a_cell_are_plain_means_in_eq_9() -> None:
    grid = GridMap(SMALL)
    grid.update(one_point(0.0, 0.0, (0.5, 0.0), z=0.0))
    grid.update(one_point(0.8, 0.0, (0.5, 0.0), z=0.05))
    cell = cell_at(grid, 0.5, 0.0)
    assert grid.mean_height(cell) == pytest.approx(0.025, abs=1e-6)
    assert grid.mean_width(cell) == pytest.approx(10 * (0.50 + 0.45) / 2 / 100, rel=1e-5)


def test_a_cell_that_was_hardly_seen_beats_a_weak_object_in_the_published_mean_alone() -> None:
    """The failure of multi-view picking with thin objects."""
    weak, glimpse = (0.5, 0.0), (0.52, 0.02)
    best = {}
    for name, config in (("published", SMALL), ("robust", ROBUST)):
        grid = GridMap(config)
        for _ in range(200):
            grid.update(one_point(0.38, 0.0, weak))
        grid.update(one_point(0.02, 0.0, glimpse))
        best[name] = grid.best_cell()
    assert best == {"published": cell_at(grid, *glimpse), "robust": cell_at(grid, *weak)}


def test_pixels_without_a_return_do_not_count_as_seen() -> None:
    view = one_point(0.9, 0.0, (0.5, 0.0))
    for measured, count in ((True, 1), (False, 0)):
        seen = replace(view, measured=np.full((1, 1), measured))
        grid = GridMap(SMALL)
        assert (grid.update(seen) == -1).all() == (not measured)
        assert grid.counts.sum() == count
        forgiving = GridMap(replace(SMALL, filled_counts=True))
        forgiving.update(seen)
        assert forgiving.counts.sum() == 1


@pytest.mark.parametrize("cell", [(0, 0), (0, 2), (4, 1), (1, 0), (3, 4)])
def test_cells_on_the_border_of_the_published_grid_are_never_the_best(cell: tuple[int, int]) -> None:
    grids = GridMap(SMALL), GridMap(replace(SMALL, border_counts=True))
    x, y = grids[0].position(cell)
    for grid in grids:
        grid.update(one_point(0.9, 0.0, (x, y)))
    assert grids[0].best_cell() is None
    assert grids[1].best_cell() == cell


@pytest.mark.parametrize("cell", [(1, 1), (1, 3), (3, 1), (3, 3)])
def test_cells_next_to_the_border_can_be_the_best(cell: tuple[int, int]) -> None:
    grid = GridMap(SMALL)
    x, y = grid.position(cell)
    grid.update(one_point(0.9, 0.0, (x, y)))
    assert grid.best_cell() == cell


def test_a_robust_map_where_all_is_in_the_lowest_bin_has_no_best_grasp() -> None:
    grid = GridMap(ROBUST_GRID)
    assert grid.best_grasp() is None
    grid.update(flat_map(0.05, looking_down([0.5, 0.0, 0.5])))
    assert grid.observations().sum() > 0
    assert grid.best_grasp() is None


def test_one_lucky_pixel_does_not_beat_a_cell_that_was_seen_well() -> None:
    grid = GridMap(ROBUST)
    for _ in range(60):
        grid.update(one_point(0.75, 0.2, (0.5, 0.0)))
    grid.update(one_point(1.0, 0.2, (0.54, 0.03)))
    assert grid.best_cell() == cell_at(grid, 0.5, 0.0)


def test_every_cell_lies_at_its_place_on_the_axes() -> None:
    grid = GridMap(GridConfig(extent=0.11, cell=0.01, centre=(0.3, -0.2)))
    for cell in np.ndindex(grid.shape):
        assert cell_at(grid, *grid.position((cell[0], cell[1]))) == cell
    x, y = grid.axes()
    assert (x.mean(), y.mean()) == pytest.approx((0.3, -0.2))


def test_both_readings_of_table_one_have_their_cells() -> None:
    assert GridConfig().shape == (136, 136)
    assert GridConfig(extent=EXTENT_PUBLISHED).shape == (68, 68)


def test_a_remembered_failure_lowers_quality_around_it_only() -> None:
    grid, blob = GridMap(ROBUST_GRID), Blob(x=0.5, y=0.0)
    second = Blob(x=0.6, y=0.05, quality=lambda height: 0.6)
    T = looking_down([0.55, 0.0, 0.45])
    for _ in range(10):
        grid.update(blob_map(blob, T, None))
    before = grid.mean_quality().copy()
    grid.suppress(np.array([0.5, 0.0, 0.02]))
    cell, far = cell_at(grid, 0.5, 0.0), cell_at(grid, 0.56, 0.0)
    assert before[cell] - grid.mean_quality()[cell] == pytest.approx(0.5, abs=0.06)
    assert grid.mean_quality()[far] == pytest.approx(before[far], abs=1e-6)
    for _ in range(10):
        grid.update(blob_map(second, T, None))
    best = grid.best_grasp()
    assert best is not None
    assert np.hypot(*(best.position[:2] - [0.5, 0.0])) > 0.008


def test_a_failure_fades_by_half_with_every_other_one() -> None:
    grid = GridMap()
    places = [np.array([0.4 + 0.05 * k, 0.0, 0.02]) for k in range(4)]
    for place in places:
        grid.suppress(place)
    lowered = [float(grid.failures[cell_at(grid, *place[:2])]) for place in places]
    assert lowered[-1] == pytest.approx(0.5, abs=0.06)
    np.testing.assert_allclose(np.array(lowered[1:]) / lowered[:-1], 2.0, rtol=1e-3)


@pytest.mark.parametrize(
    "settings",
    [
        {"cell": 0.0},
        {"cell": 1.0},
        {"n_quality": 1},
        {"n_angle": 1},
        {"z_floor": 0.2},
        {"evidence": -1.0},
        {"failure_sigma": 0.0},
    ],
)
def test_settings_that_make_no_grid_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        GridConfig(**settings)


def test_a_grid_may_have_no_prior_and_no_evidence() -> None:
    assert GridConfig(evidence=0.0, prior_count=0.0).prior_count == 0.0


def test_a_grid_may_be_a_single_cell() -> None:
    assert GridConfig(extent=0.1, cell=0.1).shape == (1, 1)
