"""Parts of the quadratic program of the differential inverse kinematics, and its answer without limits.

mink has the parts too, but multiplies with BLAS, whose kernel decides over the last digit
(`mpgrasp.linear_algebra`).
"""

from __future__ import annotations

from collections.abc import Sequence

import mink
import mujoco
import numpy as np
from mink.tasks import BaseTask

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import Svd, product


class ToolTask(BaseTask):
    """Objective of one tick: bring the tool to its pose, and the elbow home where that leaves it free.

    It is |J x - error|^2 + posture_cost^2 |x - swing|^2 of the step x (7,) [rad].

    Args:
        J: tool Jacobian (6, 7), world axes, linear then angular.
        error: way to go (6,), world axes [m, rad].
        swing: step (7,) that the elbow would take [rad].
        posture_cost: weight of the elbow against 1 for the tool.
    """

    def __init__(self, J: FloatArray, error: FloatArray, swing: FloatArray, posture_cost: float) -> None:
        self._J, self._error, self._swing, self._weight = J, error, swing, posture_cost**2

    def compute_qp_objective(self, configuration: mink.Configuration) -> mink.Objective:
        """Return the Hessian (7, 7) and the gradient (7,) at no step; `configuration` is not read."""
        H = product(self._J.T, self._J)
        H.flat[:: len(H) + 1] += self._weight
        return mink.Objective(H, -product(self._J.T, self._error) - self._weight * self._swing)


def free_step(
    factors: Svd, error: FloatArray, swing: FloatArray, posture_cost: float, damping: float
) -> FloatArray:
    """Return the step (7,) [rad] that is the best of all, limits or not: the program's answer without any.

    Args:
        factors: of the tool Jacobian.
        error: as in `ToolTask`.
        swing: as there.
        posture_cost: as there.
        damping: added to the diagonal of the program's Hessian; one of the two must be above 0.
    """
    weight = posture_cost**2
    Vt, sigma = factors.Vt, factors.sigma
    along = product(Vt, swing)
    for_tool = (sigma * product(factors.U.T, error) + weight * along) / (sigma * sigma + (weight + damping))
    share = weight / (weight + damping)
    return product(Vt.T, for_tool - share * along) + share * swing


class ClearanceLimit(mink.CollisionAvoidanceLimit):
    """mink's limit on the approach of pairs of geoms, with a row for each pair in range and no other."""

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """Return G (n, 7) and h (n,) with G x <= h for the step x [rad]; neither with nothing in range."""
        model, data = self.model, configuration.data
        fromto, first, second = np.zeros(6), np.empty((3, model.nv)), np.empty((3, model.nv))
        rows, bounds = [], []
        for a, b in self.geom_id_pairs:
            distance = mujoco.mj_geomDistance(model, data, a, b, self.collision_detection_distance, fromto)
            if distance >= self.collision_detection_distance:
                continue
            normal = fromto[3:] - fromto[:3]
            mujoco.mju_normalize3(normal)
            mujoco.mj_jac(model, data, first, None, fromto[:3], model.geom_bodyid[a])
            mujoco.mj_jac(model, data, second, None, fromto[3:], model.geom_bodyid[b])
            away = product((second - first).T, normal)
            rows.append(-away if distance >= 0 else away)
            free = max(0.0, distance - self.minimum_distance_from_collisions)
            bounds.append(self.gain * free / dt + self.bound_relaxation)
        if not rows:
            return mink.Constraint()
        return mink.Constraint(G=np.array(rows), h=np.array(bounds))


class Clearance:
    """Knows where nothing that must not collide is near, without measuring in every tick.

    Between two postures no distance within the arm, or to what stands still, changes by more than
    `LEVER` times the sum of what the joints have turned.
    """

    LEVER = 1.3
    """Farthest that a point of arm or hand is from the axis of a joint that moves it [m], and more."""
    _SIGHT = 0.3
    """Distances up to this one are measured [m]: the farther one looks, the longer one need not."""

    def __init__(self, model: mujoco.MjModel, pairs: Sequence[tuple[int, int]], near: float) -> None:
        """Look after pairs of geoms; `near` is the distance from which on they matter [m]."""
        self._model, self._pairs, self._near = model, pairs, near
        self._q = np.full(model.nq, np.inf)
        self._spare = -np.inf  # distance to `near` at _q

    def is_ample(self, data: mujoco.MjData) -> bool:
        """True if no pair is as near as that; `data` has the kinematics of its positions."""
        if not self._pairs:
            return True
        turned = float(np.abs(data.qpos - self._q).sum())
        if turned * self.LEVER < self._spare:
            return True
        self._q = data.qpos.copy()
        self._spare = (
            min(mujoco.mj_geomDistance(self._model, data, a, b, self._SIGHT, None) for a, b in self._pairs)
            - self._near
        )
        return self._spare > 0
