"""Laws of cameras of another kind: pixels fly between two sides, hollows look deeper, patches are lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.camera.noise import DepthNoise, apply
from mpgrasp.camera.other_sensors import flying_pixels, lost_patches, multipath
from mpgrasp.exceptions import ConfigError

QUIET = DepthNoise(subpixel=0.0, disparity_step=0.0, shadows=False)


def step(near: float = 0.42, far: float = 0.5) -> np.ndarray:
    depth = np.full((480, 640), far, np.float32)
    depth[180:300, 250:390] = near
    return depth


def test_a_share_of_the_pixels_at_edges_lies_between_both_sides_and_no_other_moves() -> None:
    depth = step()
    found = flying_pixels(depth, 0.3, np.random.default_rng(0))
    inside = (depth == np.float32(0.42)).astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    edge = cv2.dilate(inside, kernel) != cv2.erode(inside, kernel)
    moved = found != depth
    assert not moved[~edge].any()
    assert moved[edge].mean() == pytest.approx(0.3, abs=0.05)
    assert ((found >= 0.42) & (found <= 0.5)).all()
    places = (found[moved] - 0.42) / 0.08
    assert places.mean() == pytest.approx(0.5, abs=0.05)


def test_no_pixel_flies_on_a_slope_or_into_a_hole() -> None:
    slope = np.tile(np.linspace(0.4, 0.5, 640, dtype=np.float32), (480, 1))
    assert np.array_equal(flying_pixels(slope, 1.0, np.random.default_rng(0)), slope)
    holed = step()
    holed[200:220, 245:255] = np.nan
    found = flying_pixels(holed, 1.0, np.random.default_rng(0))
    assert np.array_equal(np.isnan(found), np.isnan(holed))
    assert np.nanmin(found) >= np.float32(0.42)


def test_the_generator_advances_alike_whatever_is_seen() -> None:
    rngs = [np.random.default_rng(1) for _ in range(2)]
    noise = DepthNoise(flying=0.5, dropout=0.1)
    for depth, rng in zip((step(), np.full((480, 640), 0.5, np.float32)), rngs, strict=True):
        apply(depth, D435_INTRINSICS, rng, noise)
    assert rngs[0].random() == rngs[1].random()


def test_multipath_makes_the_foot_of_a_step_deeper_and_leaves_a_plane_alone() -> None:
    plane = np.full((480, 640), 0.5, np.float32)
    assert np.allclose(multipath(plane, 0.3), plane, atol=1e-6)
    depth = step()
    error = multipath(depth, 0.3) - depth
    assert (error >= 0).all()
    assert error[240, 248] == pytest.approx(0.3 * 0.08 / 2, rel=0.15)  # half of the surroundings is nearer
    assert error[240, 320] == pytest.approx(0.0, abs=1e-4)
    assert error[240, 200] == pytest.approx(0.0, abs=1e-4)
    assert np.allclose(multipath(depth, 0.6) - depth, 2 * error, atol=1e-6)


def test_holes_stay_holes_under_multipath_and_nobody_sees_them() -> None:
    holed = np.full((480, 640), 0.5, np.float32)
    holed[200:240, 300:340] = np.nan
    found = multipath(holed, 0.5)
    assert np.array_equal(np.isnan(found), np.isnan(holed))
    assert np.nanmax(np.abs(found - 0.5)) < 1e-5


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_as_many_pixels_are_lost_as_it_says_and_in_patches(share: float) -> None:
    measured = apply(
        np.full((480, 640), 0.5, np.float32),
        D435_INTRINSICS,
        np.random.default_rng(2),
        replace(QUIET, dropout=share, dropout_px=4.0),
    )
    lost = np.isnan(measured)
    assert lost.mean() == pytest.approx(share, rel=0.25)
    beside = lost[:, 1:][lost[:, :-1]].mean()
    assert beside > 0.75, "what is lost has lost neighbours"
    assert lost_patches(np.zeros((4, 4), np.float32), 0.4).sum() == 0


def test_a_d435_has_none_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise AssertionError("an error of another camera")

    for name in ("flying_pixels", "multipath", "lost_patches"):
        monkeypatch.setattr(f"mpgrasp.camera.noise.{name}", fail)
    apply(step(), D435_INTRINSICS, np.random.default_rng(3), DepthNoise())


@pytest.mark.parametrize(
    "change",
    [{"flying": 1.1}, {"flying": -0.1}, {"dropout": 1.0}, {"multipath": -1.0}, {"dropout_px": np.nan}],
)
def test_what_no_camera_has_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=f"{next(iter(change))} of the depth sensor"):
        DepthNoise(**change)
