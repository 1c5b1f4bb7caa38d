from itertools import combinations
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.camera.noise import DepthNoise, apply, white_noise
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.exceptions import ConfigError

D435 = DepthNoise()
SILENT: dict[str, Any] = {"subpixel": 0.0, "disparity_step": 0.0}
SMALL = CameraIntrinsics(fx=385.0, fy=385.0, cx=119.5, cy=79.5, width=240, height=160)


def _flat(z: float, intrinsics: CameraIntrinsics = D435_INTRINSICS) -> np.ndarray:
    return np.full((intrinsics.height, intrinsics.width), z, np.float32)


@pytest.mark.parametrize("z", [0.25, 0.5, 1.0])
def test_deviation_grows_with_the_square_of_the_distance(z: float) -> None:
    noise = DepthNoise(disparity_step=0)
    measured = apply(_flat(z), D435_INTRINSICS, np.random.default_rng(0), noise)
    assert np.nanstd(measured) == pytest.approx(z**2 * 0.08 / (447 * 0.05), rel=0.03)
    assert np.nanmean(measured) == pytest.approx(z, rel=2e-4)


def test_deviation_at_half_a_metre_is_nine_tenths_of_a_millimetre() -> None:
    measured = apply(_flat(0.5), D435_INTRINSICS, np.random.default_rng(0), D435)
    assert np.nanstd(measured) == pytest.approx(0.9e-3, rel=0.03)


def test_variance_is_even_over_the_image() -> None:
    rng = np.random.default_rng(1)
    stack = np.stack([apply(_flat(0.5, SMALL), SMALL, rng, D435) for _ in range(150)])
    spread = stack.std(axis=0)
    assert spread[:3].mean() == pytest.approx(spread[70:90].mean(), rel=0.05)
    assert spread[:, -3:].mean() == pytest.approx(spread[:, 100:140].mean(), rel=0.05)


def test_neighbours_are_correlated_and_strangers_are_not() -> None:
    noise = DepthNoise(disparity_step=0)
    error = apply(_flat(0.5), D435_INTRINSICS, np.random.default_rng(2), noise) - 0.5

    def correlation(shift: int) -> float:
        return float(np.corrcoef(error[:, shift:].ravel(), error[:, :-shift].ravel())[0, 1])

    blur = noise.correlation_px * 385 / 447
    for shift in (1, 2, 4):  # noise blurred by a Gaussian of s is correlated by exp(-d^2 / 4 s^2)
        assert correlation(shift) == pytest.approx(np.exp(-(shift**2) / (4 * blur**2)), abs=0.03)
    assert abs(correlation(15)) < 0.03


def test_disparities_lie_on_a_lattice_of_one_thirty_second() -> None:
    measured = apply(_flat(0.5), D435_INTRINSICS, np.random.default_rng(3), D435)
    steps = 447 * 0.05 / measured.astype(float) * 32
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
    assert len(np.unique(np.rint(steps))) > 5


@pytest.mark.parametrize(("near", "far"), [(0.40, 0.50), (0.46, 0.50), (0.3, 0.6)])
def test_shadow_is_as_wide_as_triangulation_says_and_left_of_the_near_object(near: float, far: float) -> None:
    depth = _flat(far, SMALL)
    depth[40:120, 100:140] = near
    noise = DepthNoise(**SILENT)
    measured = apply(depth, SMALL, np.random.default_rng(0), noise)
    width = 385 * 0.05 * (1 / near - 1 / far)
    lost = np.isnan(measured)
    assert lost[80].sum() == pytest.approx(width, abs=0.51)
    assert lost[80, 100 - round(width) : 100].all()
    assert not lost[:40].any()
    assert not lost[120:].any()
    np.testing.assert_allclose(measured[~lost], depth[~lost], rtol=1e-5)
    assert not np.isnan(
        apply(depth, SMALL, np.random.default_rng(0), DepthNoise(**SILENT, shadows=False))
    ).any()


def test_shadows_agree_with_a_search_over_all_pairs() -> None:
    rng = np.random.default_rng(5)
    depth = np.repeat(rng.uniform(0.3, 0.6, (40, 24)), 10, axis=1).astype(np.float32)
    small = CameraIntrinsics(fx=385.0, fy=385.0, cx=119.5, cy=19.5, width=240, height=40)
    lost = np.isnan(apply(depth, small, rng, DepthNoise(**SILENT, max_incidence=np.pi / 2)))
    right = np.arange(240) - 385 * 0.05 / depth
    for row in range(40):
        for col in range(239):
            gap = right[row, col + 1 :].min() - right[row, col]
            if abs(gap - 0.5) > 1e-3:
                assert lost[row, col] == (gap < 0.5)


def test_nothing_nearer_than_min_z_returns() -> None:
    depth = _flat(0.30, SMALL)
    depth[:, :80] = 0.17
    depth[:, 80:160] = 0.2
    measured = apply(depth, SMALL, np.random.default_rng(0), DepthNoise(shadows=False))
    assert np.isnan(measured[:, :78]).all()
    assert not np.isnan(measured[:, 84:]).any()


@pytest.mark.parametrize("axis", [0, 1])
def test_surfaces_at_grazing_angles_are_missing(axis: int) -> None:
    position = np.arange(SMALL.height)[:, None] if axis == 0 else np.arange(SMALL.width)
    for incidence, expected in ((70, False), (86, True)):
        # a plane through z = 0.5 m: 1 / z is linear in the image
        centre = (SMALL.cy, SMALL.cx)[axis]
        tangent = np.tan(np.deg2rad(incidence))
        inverse = (1 - tangent * (position - centre) / 385) / 0.5
        depth = np.broadcast_to(1 / np.maximum(inverse, 1.0), (160, 240)).astype(np.float32)
        noise = DepthNoise(**SILENT, shadows=False, max_incidence=np.deg2rad(82))
        lost = np.isnan(apply(depth, SMALL, np.random.default_rng(0), noise))
        assert lost[80, 120] == expected


def test_grazing_slopes_agree_with_looking_at_every_pixel() -> None:
    rng = np.random.default_rng(6)
    depth = np.full((30, 40), 0.5)
    depth[5:12, 8:30] -= np.linspace(0, 0.3, 22)  # some of it steep, some not, and rims all around
    depth[15:28, 10:20] += np.linspace(0, 0.4, 13)[:, None]
    depth += rng.normal(0, 0.002, depth.shape)
    image = CameraIntrinsics(fx=385.0, fy=300.0, cx=20.0, cy=15.0, width=40, height=30)
    steepest = 1.0
    noise = DepthNoise(**SILENT, shadows=False, max_incidence=steepest)
    lost = np.isnan(apply(depth.astype(np.float32), image, rng, noise))
    for row, col in np.ndindex(depth.shape):
        expected = False
        for line, k, focal in ((depth[row], col, image.fx), (depth[:, col], row, image.fy)):
            if 0 < k < len(line) - 1:
                before, after = line[k] - line[k - 1], line[k + 1] - line[k]
                least = np.tan(steepest) * line[k] / focal
                expected |= min(before, after) > least or max(before, after) < -least
        assert lost[row, col] == expected, (row, col)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2)])
def test_images_too_small_for_slopes_and_shadows_come_back(shape: tuple[int, int]) -> None:
    image = CameraIntrinsics(fx=385.0, fy=385.0, cx=0.0, cy=0.0, width=shape[1], height=shape[0])
    assert np.isfinite(apply(_flat(0.5, image), image, np.random.default_rng(0), D435)).all()


def test_rims_of_flat_objects_are_kept() -> None:
    depth = _flat(0.5, SMALL)
    depth[60:100, 100:140] = 0.42
    measured = apply(depth, SMALL, np.random.default_rng(0), DepthNoise(**SILENT, shadows=False))
    assert not np.isnan(measured).any()


def test_holes_in_the_truth_stay_holes() -> None:
    depth = _flat(0.5, SMALL)
    depth[30:50, 60:90] = np.nan
    measured = apply(depth, SMALL, np.random.default_rng(0), D435)
    assert np.isnan(measured[30:50, 60:90]).all()
    assert np.isnan(measured).sum() == 20 * 30


def test_same_seed_gives_the_same_bytes_whatever_was_seen() -> None:
    first, second, other = (np.random.default_rng(s) for s in (0, 0, 1))
    a = apply(_flat(0.5, SMALL), SMALL, first, D435)
    b = apply(_flat(0.5, SMALL), SMALL, second, D435)
    assert a.tobytes() == b.tobytes()
    assert a.tobytes() != apply(_flat(0.5, SMALL), SMALL, other, D435).tobytes()
    apply(np.full((160, 240), np.nan, np.float32), SMALL, first, D435)
    apply(_flat(0.3, SMALL), SMALL, second, D435)
    assert first.random() == second.random()


def test_input_is_left_alone() -> None:
    depth = _flat(0.5, SMALL)
    apply(depth, SMALL, np.random.default_rng(0), D435)
    assert (depth == 0.5).all()


def test_stress_mode_multiplies_the_depth() -> None:
    noise = DepthNoise(**SILENT, multiplicative=0.03)
    measured = apply(_flat(0.5, SMALL), SMALL, np.random.default_rng(0), noise)
    assert measured.std() == pytest.approx(0.015, rel=0.03)


@pytest.mark.parametrize(
    "bad", [{"baseline": 0.0}, {"subpixel": -1.0}, {"max_incidence": 2.0}, {"min_z": float("nan")}]
)
def test_impossible_sensors_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="allowed"):
        DepthNoise(**bad)


def test_white_noise_is_normal_and_no_two_images_of_a_generator_are_alike() -> None:

    rng = np.random.default_rng(0)
    images = [white_noise((300, 400), rng) for _ in range(4)]
    for image in images:
        assert image.mean() == pytest.approx(0, abs=0.012)
        assert image.std() == pytest.approx(1, abs=0.01)
        assert kstest(image[::7, ::7].ravel(), "norm").pvalue > 1e-3
        beside, below = (image[:, :-1] * image[:, 1:]).mean(), (image[:-1] * image[1:]).mean()
        assert abs(beside) < 0.012
        assert abs(below) < 0.012
    for one, other in combinations(images, 2):
        assert abs((one * other).mean()) < 0.012
    again = white_noise((300, 400), np.random.default_rng(0))
    assert again.tobytes() == images[0].tobytes()
