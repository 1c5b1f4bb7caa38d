"""Sensors of the training views: each view has one of its own, so that no network learns a single camera.

Noise, its correlation, steps, waves that stay, shadows and holes are drawn over wider ranges than those of a
D435. What a time-of-flight camera does at edges and in hollows, and what a projected pattern loses, is left
out on purpose: the ladder `transfer` asks how a network does with a camera that its training never saw.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpgrasp.camera.fixed_pattern import FixedPattern
from mpgrasp.camera.noise import DepthNoise

BASELINE = (0.03, 0.06)
"""Least and greatest distance between the imagers [m]."""
SUBPIXEL = (0.02, 0.6)
"""Least and greatest noise of the disparity, evenly drawn in its logarithm [px]."""
CORRELATION_PX = (0.5, 5.0)
"""Range of the noise's correlation [px]."""
STEPS = (0.0, 1 / 64, 1 / 32, 1 / 16, 1 / 8)
"""Quanta of the disparity, each as likely [px]."""
WAVES = 0.5
"""Share of the sensors with waves in depth that stay ..."""
WAVE = (0.01, 0.2)
"""... their range [px] ..."""
WAVE_PX = (6.0, 40.0)
"""... and that of their correlation [px]."""
NO_SHADOWS = 0.2
"""Share of the sensors without shadows beside edges."""
INCIDENCE = (60.0, 89.0)
"""Range of the angle from the normal beyond which surfaces are missing [degree]."""
WHITE = 0.2
"""Share of the sensors with white noise that multiplies the depth ..."""
WHITE_NOISE = 0.003
"""... of at most this standard deviation [-]."""
BAD_BORDER = 0.3
"""Share of the views with bad matches along one side or more."""
BORDER_PX = (2, 16)
"""Range of the width of such a band [px of 224] ..."""
PIECE_PX = (4, 40)
"""... that of the length of a piece of it ..."""
PIECE_DEPTH = (0.75, 1.15)
"""... and that of its depth, as a share of what is there."""
PIECE_LOST, PIECE_WRONG = 0.35, 0.45
"""Share of the pieces that are lost, and that have a wrong depth; the rest is as it was."""


def random_sensor(rng: np.random.Generator) -> DepthNoise:
    """Draw a sensor."""
    waves, wave, white = rng.random() < WAVES, rng.uniform(*np.log(WAVE)), rng.random() < WHITE
    return DepthNoise(
        baseline=float(rng.uniform(*BASELINE)),
        subpixel=float(np.exp(rng.uniform(*np.log(SUBPIXEL)))),
        correlation_px=float(rng.uniform(*CORRELATION_PX)),
        disparity_step=float(rng.choice(STEPS)),
        shadows=bool(rng.random() >= NO_SHADOWS),
        max_incidence=float(np.deg2rad(rng.uniform(*INCIDENCE))),
        fixed_pattern=float(np.exp(wave)) if waves else 0.0,
        pattern_px=float(rng.uniform(*WAVE_PX)),
        multiplicative=float(rng.uniform(0, WHITE_NOISE)) if white else 0.0,
    )


def waves(
    noise: DepthNoise, shape: tuple[int, int], scale: float, rng: np.random.Generator
) -> NDArray[np.float32] | None:
    """Return a sensor's waves (H, W) in an image whose focal length is `scale` of its own [px], or None."""
    return FixedPattern(noise, shape, scale, rng).at(0.0) if noise.fixed_pattern > 0 else None


def bad_border(
    depth: NDArray[np.float32], rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return depths (H, W) with bad matches along some sides, and True where they are no longer believed.

    Stereo matching has nothing to match with beside the image's border: pieces of it are lost, or lie at a
    depth that is not there. A network that never saw this takes such a piece for the best grasp of all.

    Args:
        depth: (H, W) measured z-depth [m], NaN = no return.
        rng: source of the bands.
    """
    bad = np.zeros(depth.shape, bool)
    if rng.random() >= BAD_BORDER:
        return depth, bad
    depth = depth.copy()
    for side in rng.permutation(4)[: rng.integers(1, 4)]:
        width = int(rng.integers(BORDER_PX[0], BORDER_PX[1] + 1))
        # views of the arrays, turned so that the side is at the top
        image, spoilt = np.rot90(depth, side), np.rot90(bad, side)
        column = 0
        while column < image.shape[1]:
            piece = np.s_[: int(rng.integers(1, width + 1)), column : column + int(rng.integers(*PIECE_PX))]
            kind, share = rng.random(), np.float32(rng.uniform(*PIECE_DEPTH))
            if kind < PIECE_LOST:
                image[piece] = np.nan
            elif kind < PIECE_LOST + PIECE_WRONG:
                image[piece] *= share
            spoilt[piece] |= kind < PIECE_LOST + PIECE_WRONG
            column = piece[1].stop
    return depth, bad
