"""What a network claims against what lifts: the measurement of its calibration.

Every view's best grasp, if there is one, is executed by the free-flying gripper in the scene that the view
shows. The calibration is the one under which these outcomes are likeliest; as in Platt (1999), outcomes are
taken for a little less certain than they are, so that a few lifts without a failure promise nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.detectors.networks.calibration import LEAST, MOST, Calibration
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import best_pixel
from mpgrasp.motion.lift_trial import LiftRig
from mpgrasp.outcome import Outcome
from mpgrasp.training.data.views import make_scene, stored_intrinsics, stored_pose
from mpgrasp.training.dataset import GraspDataset

BINS = 10
"""Bins of equal width over the claimed quality, for the expected calibration error."""
LEAST_SLOPE = 0.05
"""Smallest slope that is fitted: the order of claims is kept even where it says nothing."""
FEWEST = 20
"""Fewest grasps, and fewest of either ending, from which a calibration is fitted."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """The best grasp of a view and its end."""

    quality: float
    """Claimed [0, 1]."""
    lifted: bool


def stored_frame(dataset: GraspDataset, index: int) -> DepthFrame:
    """Return a view of a data set as the frame that its camera took.

    Raises:
        ConfigError: shards without the columns of the camera's pose.
    """
    sample = dataset.sample(index)
    try:
        T = stored_pose(dataset.meta[index], dataset.columns)
    except KeyError as error:
        raise ConfigError(
            "shards without the camera's pose", got=dataset.columns, allowed=str(error)
        ) from error
    return DepthFrame.from_camera(
        sample.depth,
        rgb=sample.rgb,
        intrinsics=stored_intrinsics(),
        T_world_camera=T,
        unit=1.0,
        no_return=0.0,
    )


def claims(detector: GraspDetector, dataset: GraspDataset, images: Iterable[int]) -> Iterator[Claim]:
    """Execute the best grasp of each image; images without any are left out.

    Args:
        detector: gives claims as they are, without a calibration.
        dataset: views that tell scene and pose.
        images: which of them, those of a scene one after the other.

    Raises:
        ConfigError: shards without the columns of the camera's pose.
    """
    scene, rig = None, None
    for i in images:
        found = detector.predict(stored_frame(dataset, i))
        grasp = found.grasp_at(*best_pixel(found.quality))
        if not (grasp.quality > 0 and np.isfinite(grasp.position).all()):
            continue
        if rig is None or scene != dataset.scene(i):
            scene = dataset.scene(i)
            rig = LiftRig(make_scene(*scene)[0])
        yield Claim(quality=grasp.quality, lifted=rig.attempt(grasp).outcome == Outcome.SUCCESS)


def fit(found: Iterable[Claim]) -> Calibration:
    """Return the calibration under which the outcomes of these claims are likeliest.

    Raises:
        ConfigError: fewer grasps than `FEWEST`, or of either ending.
    """
    from scipy.optimize import minimize
    from scipy.special import expit

    found = list(found)
    lifted = np.array([claim.lifted for claim in found], bool)
    right, wrong = int(lifted.sum()), int((~lifted).sum())
    if min(right, wrong) < FEWEST:
        raise ConfigError(
            "too little to calibrate by",
            got=f"{right} grasps that lift, {wrong} that do not",
            allowed=f"{FEWEST} of each: a set of more scenes",
        )
    claimed = np.clip([claim.quality for claim in found], LEAST, 1 - LEAST)
    logit = np.log(claimed / (1 - claimed))
    target = np.where(lifted, (right + 1) / (right + 2), 1 / (wrong + 2))

    def loss(parameters: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        z = parameters[0] * logit + parameters[1]
        off = expit(z) - target
        return float((np.logaddexp(0, z) - target * z).sum()), np.array([(off * logit).sum(), off.sum()])

    best = minimize(loss, np.array([1.0, 0.0]), jac=True, bounds=[(LEAST_SLOPE, MOST), (-MOST, MOST)])
    return Calibration(slope=float(best.x[0]), shift=float(best.x[1]))


def expected_error(quality: NDArray[np.float64], lifted: NDArray[np.bool_]) -> float:
    """Return the expected calibration error: the distance between mean claim and share of lifts in each of
    `BINS` bins of the claim, weighted by their numbers.

    Args:
        quality: (n,) claimed [0, 1].
        lifted: (n,) true where it lifted.
    """
    which = np.minimum((quality * BINS).astype(int), BINS - 1)
    gap = np.bincount(which, weights=quality - lifted, minlength=BINS)
    return float(np.abs(gap).sum() / max(len(quality), 1))


def measured(found: Iterable[Claim], calibration: Calibration) -> dict[str, float]:
    """Return for the card: n, share of lifts, and the expected calibration error before and after."""
    found = list(found)
    quality = np.array([claim.quality for claim in found])
    lifted = np.array([claim.lifted for claim in found], bool)
    after = calibration(quality.astype(np.float32)).astype(float)
    return {
        "n": len(found),
        "lifted": round(float(lifted.mean()), 4),
        "ece_claimed": round(expected_error(quality, lifted), 4),
        "ece_calibrated": round(expected_error(after, lifted), 4),
    }
