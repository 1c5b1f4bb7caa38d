"""Laws of the cloth's wrinkles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.cloth import GRID, HALF_EXTENT, make_cloth, make_wrinkles
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import build_scene


def test_a_crest_is_as_high_and_as_wide_as_is_asked_for_and_straight() -> None:
    for seed in range(20):
        heights = make_wrinkles(0.004, 0.04, 1, np.random.default_rng(seed))
        assert heights.max() == pytest.approx(0.004, rel=0.1)  # the crest passes between the points
        high = heights > 0.002
        row, col = np.nonzero(high)
        places = np.column_stack([col, row]) * GRID
        spread = np.sqrt(np.linalg.eigvalsh(np.cov(places.T)))
        # a strip that is uniformly filled has a deviation of its width / sqrt(12)
        assert spread[0] * np.sqrt(12) == pytest.approx(0.04, rel=0.3)
        assert spread[1] > 1.2 * spread[0]


def test_cloth_without_wrinkles_keeps_its_bits_and_with_them_its_waves() -> None:
    plain = make_cloth(0.001, 0.06, np.random.default_rng(1)).elevation
    np.testing.assert_array_equal(plain, make_cloth(0.001, 0.06, np.random.default_rng(1), None).elevation)
    wrinkles = make_wrinkles(0.005, 0.03, 5, np.random.default_rng(2))
    both = make_cloth(0.001, 0.06, np.random.default_rng(1), wrinkles).elevation
    inner = np.s_[20:-20, 20:-20]
    rise = (both - plain)[inner] - wrinkles[inner]
    assert np.ptp(rise) < 1e-12


def test_a_flat_cloth_may_have_wrinkles() -> None:
    heights = make_wrinkles(0.005, 0.03, 3, np.random.default_rng(0))
    assert make_cloth(0.0, 0.06, np.random.default_rng(0), heights).elevation.max() > 0.004


def test_wrinkles_depend_on_the_seed_and_on_nothing_that_is_drawn_beside_them() -> None:
    def cloth(seed: int, **changes: float) -> np.ndarray:
        return build_scene(SceneConfig(**changes), seed, robot=False).cloth.elevation  # type: ignore[arg-type]

    plain, wrinkled = cloth(3), cloth(3, cloth_wrinkles=0.005)
    assert wrinkled.max() > plain.max() + 0.002
    np.testing.assert_array_equal(wrinkled, cloth(3, cloth_wrinkles=0.005))
    assert not np.array_equal(wrinkled, cloth(4, cloth_wrinkles=0.005))


@pytest.mark.parametrize(
    "setting",
    [{"cloth_wrinkles": -0.001}, {"cloth_wrinkles": 0.1}, {"cloth_wrinkle_width": GRID}, {"no_return": 1.5}],
)
def test_wrinkles_and_patches_out_of_range_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="out of range"):
        SceneConfig(**setting)  # type: ignore[arg-type]


def test_all_wrinkles_lie_on_the_cloth() -> None:
    n = round(2 * HALF_EXTENT / GRID) + 1
    heights = make_wrinkles(0.005, 0.03, 50, np.random.default_rng(5))
    assert heights.shape == (n, n)
    assert heights.min() >= 0


@pytest.mark.parametrize("wavelength", [0.04, 0.06, 0.3, 1.0])
def test_waves_are_noise_through_a_gaussian_that_goes_on_at_the_other_side(wavelength: float) -> None:
    noise = np.random.default_rng(5).standard_normal((121, 121))
    sigma = wavelength / (2 * np.pi * np.sqrt(2)) / GRID
    smooth = gaussian_filter(noise, sigma, mode="wrap")
    surface = make_cloth(0.001, wavelength, np.random.default_rng(5)).elevation[20:-20, 20:-20]
    # what is left apart are a factor and a shift
    np.testing.assert_allclose(
        (surface - surface.mean()) / surface.std(),
        (smooth[20:-20, 20:-20] - smooth[20:-20, 20:-20].mean()) / smooth[20:-20, 20:-20].std(),
        atol=1e-9,
    )
