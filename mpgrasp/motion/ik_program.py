"""Parts of the quadratic program of the differential inverse kinematics, for mink to put together.

mink has both, but multiplies with BLAS, whose kernel decides over the last digit (`mpgrasp.linear_algebra`).
"""

from __future__ import annotations

import mink
import mujoco
import numpy as np
from mink.tasks import BaseTask

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import product


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
