"""Errors of a stereo depth camera: noise, steps, shadows and holes in the true depth image.

The model is that of an Intel RealSense D435, whose depth is f B / disparity with the disparity matched
between two imagers a baseline apart (Keselman et al. 2017, "Intel RealSense stereoscopic depth cameras";
Intel, "Best known methods for tuning RealSense D400 depth cameras"). Lengths in pixels are the sensor's, at
its own focal length, and are scaled to whatever image is at hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.camera.other_sensors import flying_pixels, lost_patches, multipath
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.exceptions import ConfigError
from mpgrasp.linear_algebra import norm

_HALF_PIXEL = np.float32(0.5)


@dataclass(frozen=True, kw_only=True)
class DepthNoise:
    """Figures of the sensor; the defaults are a D435's."""

    baseline: float = 0.050
    """Distance between the imagers [m]; D400 series datasheet."""
    focal_px: float = 447.0
    """Focal length at which disparities are matched [px]; D435 at 848 x 480."""
    subpixel: float = 0.08
    """Standard deviation of the disparity [px]; Intel's tuning guide expects below 0.1 when well tuned."""
    correlation_px: float = 2.0
    """Standard deviation of the Gaussian that correlates neighbouring disparities [px]; assumed, because
    matching windows overlap."""
    disparity_step: float = 1 / 32
    """Quantum of the reported disparity [px]; the D4 chip matches to five fractional bits."""
    min_z: float = 0.18
    """Nearest depth that is reported [m]; datasheet, about 0.18 at 848 x 480."""
    shadows: bool = True
    """True if background that the right imager cannot see is missing."""
    max_incidence: float = float(np.deg2rad(82.0))
    """Surfaces seen at a larger angle from their normal are missing [rad]; assumed: at half a metre a
    matching window a few pixels wide then spans several pixels of disparity."""
    fixed_pattern: float = 0.0
    """Standard deviation of a disparity error that stays, the same in all frames of an episode [px]; 0.06
    makes waves of 2.7 mm at 1 m, as users report of D400 cameras (`mpgrasp.camera.fixed_pattern`)."""
    pattern_px: float = 20.0
    """Standard deviation of the Gaussian that correlates this error in the image [px]; assumed, from
    pictures of such waves."""
    pattern_time: float = 0.0
    """Time over which it changes into another pattern [s]; 0 = never."""
    multiplicative: float = 0.0
    """Stress mode, not a D435: standard deviation of white noise that multiplies the depth [-]."""
    multipath: float = 0.0
    """Another camera, time of flight: error of what lies below its surroundings, over that depth [-]."""
    flying: float = 0.0
    """Another camera, time of flight: share of the pixels at edges that lie between both sides [0, 1]."""
    dropout: float = 0.0
    """Another camera, of projected patterns: share of the pixels that each frame loses in patches [0, 1)."""
    dropout_px: float = 3.0
    """Standard deviation of the Gaussian that makes these patches [px]."""

    def __post_init__(self) -> None:
        for name in ("baseline", "focal_px"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} of the depth sensor", got=getattr(self, name), allowed="above 0")
        for name in (
            "subpixel",
            "correlation_px",
            "disparity_step",
            "min_z",
            "multiplicative",
            "fixed_pattern",
            "pattern_px",
            "pattern_time",
            "multipath",
            "dropout_px",
        ):
            if not 0 <= getattr(self, name) < np.inf:
                raise ConfigError(f"{name} of the depth sensor", got=getattr(self, name), allowed="0 or more")
        for name, most in (("flying", 1.0), ("dropout", 0.95)):
            if not 0 <= getattr(self, name) <= most:
                raise ConfigError(
                    f"{name} of the depth sensor", got=getattr(self, name), allowed=f"0 to {most}"
                )
        if not 0 < self.max_incidence <= np.pi / 2:
            raise ConfigError("max_incidence", got=self.max_incidence, allowed="above 0, up to pi/2 [rad]")

    def shadow_px(self, z_near: float, z_far: float, focal_px: float) -> float:
        """Width of the shadow [px] that an edge at z_near casts on z_far [m] in an image of `focal_px`."""
        return focal_px * self.baseline * (1 / z_near - 1 / z_far)

    def margin_px(self, intrinsics: CameraIntrinsics) -> int:
        """Columns right of a window that can decide over shadows in it [px], for edges 0.15 m over 0.5 m."""
        return int(np.ceil(self.shadow_px(0.35, 0.5, intrinsics.fx))) if self.shadows else 0


def apply(
    depth: NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    rng: np.random.Generator,
    noise: DepthNoise,
    pattern: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Return what the sensor reports for a true depth image.

    The generator advances alike whatever the image shows.

    Args:
        depth: (H, W) true z-depth [m], NaN = no return.
        intrinsics: geometry of that image.
        rng: source of the noise.
        noise: the sensor.
        pattern: (H, W) disparity error that stays [px of the sensor], if there is one.

    Returns:
        (H, W) z-depth [m], a new array.
    """
    if noise.multipath > 0:
        depth = multipath(depth, noise.multipath)
    scale = intrinsics.fx / noise.focal_px
    fb = np.float32(noise.focal_px * noise.baseline)
    disparity = fb / depth
    error = correlated_noise(depth.shape, noise.correlation_px * scale, rng) * np.float32(noise.subpixel)
    error += disparity
    if pattern is not None:
        error += pattern
    if noise.disparity_step > 0:
        error *= np.float32(1 / noise.disparity_step)
        np.rint(error, out=error)
        error *= np.float32(noise.disparity_step)
    with np.errstate(divide="ignore"):
        measured: NDArray[np.float32] = np.divide(fb, error, out=error)
    if noise.multiplicative > 0:
        measured *= 1 + np.float32(noise.multiplicative) * white_noise(depth.shape, rng)
    if noise.flying > 0:
        measured = flying_pixels(measured, noise.flying, rng)
    lost = ~((measured >= noise.min_z) & np.isfinite(measured))
    if noise.shadows:
        lost |= _shadows(disparity * np.float32(scale))
    if noise.max_incidence < np.pi / 2:
        lost |= _grazing(depth, intrinsics, noise.max_incidence, noise.min_z)
    if noise.dropout > 0:
        lost |= lost_patches(correlated_noise(depth.shape, noise.dropout_px, rng), noise.dropout)
    measured[lost] = np.nan
    return measured


def white_noise(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float32]:
    """Return normal numbers (H, W) of mean 0 and variance 1, by OpenCV's generator with a seed from `rng`.

    That is quicker than numpy's; it leaves OpenCV's generator of this thread with that seed.
    """
    white = np.empty(shape, np.float32)
    cv2.setRNGSeed(int(rng.integers(2**31)))
    return np.asarray(cv2.randn(white, np.zeros(1), np.ones(1)), np.float32)


def correlated_noise(shape: tuple[int, ...], blur_px: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return white noise (H, W) blurred by a Gaussian of `blur_px`, scaled back to unit variance."""
    white = white_noise(shape, rng)
    radius = int(np.ceil(3 * blur_px))
    if radius == 0 or blur_px < 0.3:
        return white
    kernel = cv2.getGaussianKernel(2 * radius + 1, blur_px, cv2.CV_32F)
    # white noise through a separable filter has the product of both kernels' squared norms for its variance
    kernel = np.asarray(kernel / norm(kernel[:, 0]), np.float32)
    # wrapping round keeps the variance even at the border, where reflecting would double it
    padded = cv2.copyMakeBorder(white, radius, radius, radius, radius, cv2.BORDER_WRAP)
    blurred = np.asarray(cv2.sepFilter2D(padded, cv2.CV_32F, kernel, kernel), np.float32)
    return blurred[radius:-radius, radius:-radius]


def _shadows(disparity: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels (H, W) that the right imager cannot see, from disparities in pixels of this image.

    The depth image is the left imager's. A point of column u falls on column u - disparity of the right
    one and is hidden there if something further right in the left image, hence nearer, falls on the same
    column or on a lower one.
    """
    hidden = np.zeros(disparity.shape, bool)
    # neighbours on one flat surface are a whole pixel apart: half of that rounds the band's width, and a row
    # in which no disparity jumps by more than that hides nothing
    rows = _rows_with_steps(disparity[:, 1:], disparity[:, :-1], _HALF_PIXEL)
    right = np.arange(disparity.shape[1], dtype=np.float32) - disparity[rows]
    right[np.isnan(right)] = np.inf
    nearest = np.minimum.accumulate(right[:, ::-1], axis=1)[:, ::-1]
    hidden[rows, :-1] = (nearest[:, 1:] < right[:, :-1] + _HALF_PIXEL) & np.isfinite(right[:, :-1])
    return hidden


def _grazing(
    depth: NDArray[np.float32], intrinsics: CameraIntrinsics, max_incidence: float, min_z: float
) -> NDArray[np.bool_]:
    """Pixels (H, W) of surfaces whose slope against the image plane is beyond `max_incidence` [rad].

    A slope counts only where it goes on to both sides of a pixel, so that rims and narrow things are kept;
    and only at `min_z` [m] or farther, since what is nearer is missing anyway.
    """
    bound = float(np.tan(max_incidence))
    grazing = np.zeros(depth.shape, bool)
    across = _rows_with_steps(depth[:, 1:], depth[:, :-1], min_z * bound / intrinsics.fx)
    some = depth[across]
    step = np.diff(some, axis=1)
    grazing[across, 1:-1] = _steep(
        step[:, :-1], step[:, 1:], some[:, 1:-1] * np.float32(bound / intrinsics.fx)
    )
    down = _rows_with_steps(depth[1:], depth[:-1], min_z * bound / intrinsics.fy)
    rows = down[1:][np.diff(down) == 1]  # with a step above and below
    above, here, below = depth[rows - 1], depth[rows], depth[rows + 1]
    grazing[rows] |= _steep(here - above, below - here, here * np.float32(bound / intrinsics.fy))
    return grazing


def _rows_with_steps(
    some: NDArray[np.float32], others: NDArray[np.float32], least: float | np.float32
) -> NDArray[np.intp]:
    """Rows in which two images (h, w) differ anywhere by more than `least`; those with NaN too."""
    if not some.size:
        return np.zeros(0, np.intp)
    largest = np.asarray(cv2.absdiff(some, others)).max(axis=1)
    return np.flatnonzero(~(largest <= least))


def _steep(
    before: NDArray[np.float32], after: NDArray[np.float32], bound: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """True where the steps before and after a pixel both go up, or both go down, by more than the bound."""
    steepest = np.minimum(before, after)
    fall = np.maximum(before, after)
    np.maximum(steepest, np.negative(fall, out=fall), out=steepest)
    return np.asarray(steepest > bound)
