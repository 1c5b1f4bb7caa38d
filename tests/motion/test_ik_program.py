"""The answer without limits is the program's wherever no limit counts, and is taken there alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import svd
from mpgrasp.motion.ik import DifferentialIK
from mpgrasp.motion.ik_config import IkConfig
from mpgrasp.motion.ik_program import Clearance, free_step
from mpgrasp.motion.trajectory import integrate_pose
from mpgrasp.robot import panda

DT = 0.01
MARGIN = 1e-3
"""Way beyond a limit at which some postures start [rad]."""


class Program(DifferentialIK):
    """The quadratic program, asked every time."""

    def _is_free(self, q: FloatArray, step: FloatArray, dt: float) -> bool:
        return False


def postures(ik: DifferentialIK, n: int) -> list[FloatArray]:
    """Some around the home posture, some all over the joints' ranges and close to their ends."""
    rng = np.random.default_rng(n)
    low, high = ik.model.jnt_range.T
    found = []
    for k in range(n):
        q = np.array(panda.Q_HOME) + rng.normal(0, 0.3, 7) if k % 3 else rng.uniform(low, high)
        if k % 5 == 0:
            j = rng.integers(7)
            q[j] = rng.choice([low[j], high[j]]) + rng.uniform(-0.03, 0.03)
        found.append(np.clip(q, low + MARGIN, high - MARGIN))
    return found


@pytest.mark.parametrize("speed", [0.0, 0.05, 0.5, 2.0])
def test_both_ways_give_the_same_motion_at_any_posture_speed_and_limit(speed: float) -> None:
    rng = np.random.default_rng(3)
    for config in (IkConfig(), IkConfig(velocity_fraction=0.2), IkConfig(collision_range=0.2)):
        quick, program = DifferentialIK(config), Program(config)
        for q in postures(quick, 120):
            wanted = integrate_pose(quick.pose(q), rng.normal(0, speed, 6), DT)
            for ik in (quick, program):
                ik.reset()
            a, b = quick.step(q, wanted, DT), program.step(q, wanted, DT)
            np.testing.assert_allclose(a.dq, b.dq, atol=1e-8)
            assert (a.feasible, a.blocked, a.blocked_joint) == (b.feasible, b.blocked, b.blocked_joint)


def test_the_program_is_hardly_ever_asked_on_an_ordinary_way() -> None:
    asked = 0
    ik = DifferentialIK()
    free = ik._is_free

    def counted(q: FloatArray, step: FloatArray, dt: float) -> bool:
        nonlocal asked
        found = free(q, step, dt)
        asked += not found
        return found

    ik._is_free = counted  # type: ignore[method-assign]
    q = np.array(panda.Q_HOME)
    T = ik.pose(q)
    for _ in range(200):
        T = integrate_pose(T, np.array([0.03, 0.02, -0.05, 0.0, 0.0, 0.1]), DT)
        q = q + ik.step(q, T, DT).dq * DT
    assert asked == 0


@pytest.mark.parametrize(("cost", "damping"), [(1e-2, 1e-7), (0.3, 0.0), (0.0, 1e-3), (1.0, 0.5)])
def test_the_free_step_is_where_the_objective_has_no_slope(cost: float, damping: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        J, error, swing = rng.normal(size=(6, 7)), rng.normal(size=6), rng.normal(size=7)
        x = free_step(svd(J), error, swing, cost, damping)
        slope = J.T @ (J @ x - error) + cost**2 * (x - swing) + damping * x
        np.testing.assert_allclose(slope, 0, atol=1e-12)


def nearest(ik: DifferentialIK, q: FloatArray) -> float:
    """Distance of the nearest pair [m], measured there and then, up to 1 m."""
    data = mujoco.MjData(ik.model)
    data.qpos[:] = q
    mujoco.mj_kinematics(ik.model, data)
    return min(float(mujoco.mj_geomDistance(ik.model, data, a, b, 1.0, None)) for a, b in ik._geoms)


def test_the_clearance_is_measured_though_the_program_was_never_asked() -> None:
    ik = DifferentialIK(IkConfig(collision_range=0.3))
    for q in postures(ik, 60):
        ik.pose(q)
        distance = nearest(ik, q)
        assert ik.clearance() == (pytest.approx(distance, abs=1e-9) if distance < 0.3 else np.inf)


def test_no_distance_changes_faster_than_the_lever_says() -> None:
    ik = DifferentialIK()
    rng = np.random.default_rng(0)
    for q in postures(ik, 100):
        turn = rng.normal(0, 0.05, 7) * (rng.random(7) < 0.4)
        change = abs(nearest(ik, q + turn) - nearest(ik, q))
        assert change <= Clearance.LEVER * np.abs(turn).sum() + 1e-6


def test_clearance_is_ample_exactly_where_nothing_is_near_or_is_measured() -> None:
    ik = DifferentialIK()
    near = 0.12
    watch = Clearance(ik.model, ik._geoms, near)
    rng = np.random.default_rng(2)
    q = np.array(panda.Q_HOME)
    told = []
    for _ in range(400):  # a walk, so that what was measured before is used
        q = np.clip(q + rng.normal(0, 0.05, 7), *ik.model.jnt_range.T)
        ik.pose(q)
        told.append(watch.is_ample(ik.configuration.data))
        assert told[-1] == (nearest(ik, q) > near)
    assert set(told) == {True, False}
