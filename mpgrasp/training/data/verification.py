"""Analytic grasps put to the test: a free-flying gripper lifts some of every scene, and labels learn from it.

The analysis is the prior: its quality is worth `PRIOR_LIFTS` lifts. What was lifted or lost near a grasp,
about the same angle, counts by a Gaussian of distance and angle, as wide in space as the one with which the
published MVP code smooths its maps (https://github.com/dougsm/mvp_grasp). Lifts only ever lower a label: the
analysis ranks grasps better than one lift can. An audit then lifts grasps drawn from the labels as shipped.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpgrasp.detectors.antipodal.analysis import WorldGrasps, quality_along
from mpgrasp.exceptions import SimulationError
from mpgrasp.geometry import FloatArray, line_angle_difference
from mpgrasp.grasp import Grasp
from mpgrasp.height_map import HeightMap
from mpgrasp.motion.lift_trial import LiftRig
from mpgrasp.outcome import Outcome
from mpgrasp.scene.scene import Scene

TRIAL_COLUMNS = (
    "scene", "x", "y", "z", "angle", "width", "quality", "positive", "audit", "lifted",
    "shipped", "thickness", "outcome",
)  # fmt: skip
"""Columns of a shard's `trials`: index of the scene; the grasp's point on the seen surface [m], closing
direction about world z [rad] and opening [m]; analytic quality before verification; 1 for a grasp that the
analysis has, 0 for one that it excludes; 1 for an audit of the shipped labels; 1 if it lifted; quality as
shipped; how high the object rises over the cloth [m]; index into `LIFT_OUTCOMES`."""
LIFT_OUTCOMES = (Outcome.SUCCESS, Outcome.COLLISION, Outcome.MISSED, Outcome.SLIPPED)
"""Outcomes of a lift in the order of their index in shards."""
POSITIVES = 4
"""Lifts of analytic grasps per scene."""
NEGATIVES = 1
"""Lifts per scene of places on objects where the analysis has no grasp at that angle."""
AUDITS = 1
"""Lifts per scene of grasps drawn from the labels as shipped."""
GOOD = 0.3
"""Labels of this quality or more are meant to lift."""
STRATA = (0.0, 0.1, 0.3, 0.5, 0.7, 1.0)
"""Edges of the bins of quality that positives are drawn from in turn."""
SPREAD = 0.0075
"""Standard deviation of what a lift says about its neighbourhood, in space [m] ..."""
ANGLE_SPREAD = np.deg2rad(20.0)
"""... and in angle [rad]."""
PRIOR_LIFTS = 0.25
"""Weight of the analysis against one lift at the very same place."""
WIDE_OPEN = 0.070
"""Opening of grasps that the analysis excludes; the execution adds its margin [m]."""

Lift = Callable[[Grasp], Outcome]
"""Tries a grasp in the settled scene; one of `LIFT_OUTCOMES`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Verified:
    """The analysis after the lifts have corrected it, and their record."""

    grasps: WorldGrasps
    """The grasps with corrected quality."""
    trials: NDArray[np.float32]
    """(m, len(TRIAL_COLUMNS))"""


@dataclass(frozen=True, kw_only=True)
class _Trial:
    row: int
    col: int
    grasp: Grasp
    positive: bool
    outcome: Outcome
    audit: bool = False

    @property
    def lifted(self) -> bool:
        return self.outcome == Outcome.SUCCESS


def verify(
    scene: Scene, grasps: WorldGrasps, rng: np.random.Generator, *, index: int, lift: Lift | None = None
) -> Verified:
    """Lift some grasps of a scene, correct its labels by the outcome, and audit what has come of them.

    Args:
        scene: the settled scene, without the robot.
        grasps: its analysis.
        rng: draws the grasps.
        index: of the scene, for the record.
        lift: tries a grasp; a `LiftRig` of the scene by default. One that raises `SimulationError` has shown
            nothing: the trial is left out.
    """
    if lift is None:
        rig = LiftRig(scene)

        def lift(grasp: Grasp) -> Outcome:
            return Outcome(rig.attempt(grasp).outcome)

    truth = grasps.height_map
    trials: list[_Trial] = []
    for row, col in draw_positives(grasps, rng):
        grasp = _grasp_at(grasps, row, col)
        with suppress(SimulationError):
            trials.append(_Trial(row=row, col=col, grasp=grasp, positive=True, outcome=lift(grasp)))
    for row, col, angle in draw_negatives(truth, rng):
        grasp = Grasp(position=_point(truth, row, col), angle=angle, width=WIDE_OPEN, quality=0.0)
        with suppress(SimulationError):
            trials.append(_Trial(row=row, col=col, grasp=grasp, positive=False, outcome=lift(grasp)))
    shipped = corrected(grasps, [t for t in trials if t.positive])
    audits: list[_Trial] = []
    for row, col in draw_audits(shipped, {(t.row, t.col) for t in trials}, rng):
        grasp = _grasp_at(grasps, row, col)
        with suppress(SimulationError):
            outcome = lift(grasp)
            audits.append(_Trial(row=row, col=col, grasp=grasp, positive=True, audit=True, outcome=outcome))
    height = _object_heights(truth)
    record = [
        (
            index, *t.grasp.position, t.grasp.angle, t.grasp.width, t.grasp.quality, t.positive, t.audit,
            t.lifted, shipped.quality[t.row, t.col] if t.positive else 0.0,
            height[truth.label[t.row, t.col]], LIFT_OUTCOMES.index(t.outcome),
        )
        for t in trials + audits
    ]  # fmt: skip
    return Verified(
        grasps=shipped, trials=np.array(record, np.float32).reshape(len(record), len(TRIAL_COLUMNS))
    )


def corrected(grasps: WorldGrasps, trials: list[_Trial]) -> WorldGrasps:
    """Return the grasps with their quality lowered to what the lifts near them leave of it."""
    quality, truth = grasps.quality, grasps.height_map
    lifted, lost = np.zeros_like(quality), np.zeros_like(quality)
    for t in trials:
        mine = (truth.label == truth.label[t.row, t.col]) & (quality > 0)
        rows, cols = np.nonzero(mine)
        distance = np.hypot(rows - t.row, cols - t.col) * truth.cell
        turn = line_angle_difference(grasps.angle[mine], t.grasp.angle)
        weight = np.exp(-0.5 * (distance / SPREAD) ** 2 - 0.5 * (turn / ANGLE_SPREAD) ** 2)
        (lifted if t.lifted else lost)[mine] += weight
    believed = (PRIOR_LIFTS * quality + lifted) / (PRIOR_LIFTS + lifted + lost)
    return replace(grasps, quality=np.minimum(quality, believed))


def draw_positives(grasps: WorldGrasps, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Draw cells (row, col) with a grasp, spread over the objects and over the range of quality."""
    label, quality = grasps.height_map.label, grasps.quality
    objects = np.unique(label[quality > 0])
    if not len(objects):
        return []
    bins = np.digitize(quality, STRATA[1:-1])
    drawn: list[tuple[int, int]] = []
    order = rng.permutation(len(STRATA) - 1)
    objects = rng.permutation(objects)
    for k in range(POSITIVES):
        mine = (label == objects[k % len(objects)]) & (quality > 0)
        wanted = order[k % len(order)]
        # the nearest bin that the object has
        have = np.unique(bins[mine])
        nearest = have[np.argmin(np.abs(have - wanted))]
        drawn.append(_any_cell(mine & (bins == nearest), rng))
    return drawn


def draw_negatives(truth: HeightMap, rng: np.random.Generator) -> list[tuple[int, int, float]]:
    """Draw cells (row, col) on objects, and angles [rad] at which the analysis has no grasp there."""
    drawn = []
    for _ in range(NEGATIVES):
        angle = float(rng.uniform(-np.pi / 2, np.pi / 2))
        excluded = (truth.label > 0) & (quality_along(truth, angle) == 0)
        if excluded.any():
            label = rng.choice(np.unique(truth.label[excluded]))
            drawn.append((*_any_cell(excluded & (truth.label == label), rng), angle))
    return drawn


def draw_audits(
    shipped: WorldGrasps, tried: set[tuple[int, int]], rng: np.random.Generator
) -> list[tuple[int, int]]:
    """Draw cells (row, col) of shipped quality `GOOD` or better that were not lifted, any object alike."""
    fresh = shipped.quality >= GOOD
    for cell in tried:
        fresh[cell] = False
    drawn = []
    for _ in range(AUDITS):
        if fresh.any():
            label = rng.choice(np.unique(shipped.height_map.label[fresh]))
            drawn.append(_any_cell(fresh & (shipped.height_map.label == label), rng))
    return drawn


def _any_cell(mask: np.ndarray, rng: np.random.Generator) -> tuple[int, int]:
    cells = np.argwhere(mask)
    row, col = cells[rng.integers(len(cells))]
    return int(row), int(col)


def _point(truth: HeightMap, row: int, col: int) -> FloatArray:
    """Return the point (3,) of the surface [m]."""
    return np.array([truth.x0 + col * truth.cell, truth.y0 + row * truth.cell, float(truth.height[row, col])])


def _grasp_at(grasps: WorldGrasps, row: int, col: int) -> Grasp:
    return Grasp(
        position=_point(grasps.height_map, row, col),
        angle=float(grasps.angle[row, col]),
        width=float(grasps.width[row, col]),
        quality=float(grasps.quality[row, col]),
    )


def _object_heights(truth: HeightMap) -> FloatArray:
    """Return the height (n_labels,) by label to which each object rises over the cloth [m]."""
    heights = np.zeros(int(truth.label.max()) + 1)
    np.maximum.at(heights, truth.label, truth.height - truth.support)
    return heights
