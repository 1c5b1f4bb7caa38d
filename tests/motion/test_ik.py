"""Differential IK against finite differences, straight lines and unreachable poses."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down, rotation_vector
from mpgrasp.motion.ik import DifferentialIK, solve_pose
from mpgrasp.motion.ik_config import IkConfig
from mpgrasp.motion.reflex import ReflexConfig
from mpgrasp.motion.trajectory import integrate_pose, pose_error
from mpgrasp.robot import panda

DT = 0.01


@pytest.fixture(scope="module")
def ik() -> DifferentialIK:
    return DifferentialIK()


def finite_difference_jacobian(ik: DifferentialIK, q: FloatArray, h: float = 1e-6) -> FloatArray:
    columns = []
    for step in np.eye(7) * h:
        before, after = ik.pose(q - step), ik.pose(q + step)
        rotation = rotation_vector(after[:3, :3] @ before[:3, :3].T)
        columns.append(np.concatenate([after[:3, 3] - before[:3, 3], rotation]) / (2 * h))
    return np.column_stack(columns)


def random_q(seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    return panda.Q_HOME + rng.uniform(-0.4, 0.4, 7)


@pytest.mark.parametrize("seed", range(4))
def test_manipulability_is_that_of_the_finite_difference_jacobian(ik: DifferentialIK, seed: int) -> None:
    q = random_q(seed)
    J = finite_difference_jacobian(ik, q)
    solution = ik.step(q, ik.pose(q), DT)
    assert solution.manipulability == pytest.approx(np.sqrt(np.linalg.det(J @ J.T)), rel=1e-5)
    # eigenvalues instead of an SVD
    least = np.sqrt(np.linalg.eigvalsh(J @ J.T)[0])
    assert solution.min_singular_value == pytest.approx(least, rel=1e-5)
    np.testing.assert_allclose(ik.jacobian(q), J, atol=1e-7)


@pytest.mark.parametrize(
    ("position", "value"), [((0.5, 0.0, 0.4), 0.20), ((0.5, 0.34, 0.4), 0.155), ((0.7, 0.0, 0.4), 0.10)]
)
def test_known_singular_values_of_the_workspace(
    ik: DifferentialIK, position: tuple[float, ...], value: float
) -> None:
    q = solve_pose(panda.Q_HOME, looking_down(position), ik)
    assert ik.step(q, ik.pose(q), DT).min_singular_value == pytest.approx(value, abs=0.006)


def test_a_stretched_arm_has_no_manipulability_left(ik: DifferentialIK) -> None:
    # upper and lower arm in one line: the elbow's offsets of 82.5 mm over 316 and 384 mm
    q = np.array(panda.Q_HOME)
    q[3] = -np.arctan2(0.0825, 0.316) - np.arctan2(0.0825, 0.384)
    assert ik.step(q, ik.pose(q), DT).min_singular_value < 0.002


def test_demanded_velocity_is_the_least_norm_answer(ik: DifferentialIK) -> None:
    q = random_q(7)
    twist = np.array([0.05, -0.02, 0.03, 0.1, 0.2, -0.1])
    demanded = ik.step(q, integrate_pose(ik.pose(q), twist, DT), DT).demanded_dq
    np.testing.assert_allclose(demanded, np.linalg.pinv(finite_difference_jacobian(ik, q)) @ twist, atol=1e-5)


def test_a_long_path_does_not_drift(ik: DifferentialIK) -> None:
    ik.reset()
    q = np.array(panda.Q_HOME)
    T = ik.pose(q)
    for k in range(400):
        twist = np.array([0.1 * np.cos(k / 40), 0.1 * np.sin(k / 40), -0.05, 0.0, 0.0, 0.3 * np.sin(k / 60)])
        T = integrate_pose(T, twist, DT)
        solution = ik.step(q, T, DT)
        assert solution.blocked is None
        q = q + solution.dq * DT
    assert np.linalg.norm(pose_error(ik.pose(q), T)) < 1e-5


def test_commanded_velocity_obeys_the_limits_and_the_demand_shows_the_excess(ik: DifferentialIK) -> None:
    q = np.array(panda.Q_HOME)
    solution = ik.step(q, integrate_pose(ik.pose(q), np.array([3.0, 0, 0, 0, 0, 0]), DT), DT)
    assert np.all(np.abs(solution.dq) <= panda.DQ_MAX * (1 + 1e-6))
    assert np.any(np.abs(solution.demanded_dq) > panda.DQ_MAX)
    assert solution.blocked == "joint_velocity"
    assert solution.residual > 0.001


def test_a_joint_limit_holds_and_is_named(ik: DifferentialIK) -> None:
    ik.reset()
    q = np.array(panda.Q_HOME)
    q[6] = 2.7
    T = ik.pose(q)
    for _ in range(600):
        # turning the tool down-axis one way winds up joint 7
        T = integrate_pose(T, np.array([0, 0, 0, 0, 0, -0.5]), DT)
        solution = ik.step(q, T, DT)
        q = q + solution.dq * DT
        assert np.all(q >= panda.Q_MIN)
        assert np.all(q <= panda.Q_MAX)
        if solution.residual_angle > 0.02:
            break
    # the elbow gives way until another joint has no way left either
    assert solution.blocked == "joint_position"
    assert solution.blocked_joint is not None
    bounds = panda.Q_MIN[solution.blocked_joint - 1], panda.Q_MAX[solution.blocked_joint - 1]
    assert min(abs(solution.blocked_bound - bound) for bound in bounds) < 0.02


def test_the_hand_stays_clear_of_the_table_until_a_stop_is_due() -> None:
    ik = DifferentialIK()
    q = solve_pose(panda.Q_HOME, looking_down([0.5, 0.0, 0.06]), ik)
    T = ik.pose(q)
    for _ in range(300):
        T = integrate_pose(T, np.array([0, 0, -0.05, 0, 0, 0]), DT)
        solution = ik.step(q, T, DT)
        q = q + solution.dq * DT
        if solution.residual > ReflexConfig().ik_residual:
            break
    assert solution.blocked == "collision_avoidance"
    # independent of the collision code: the lowest vertex of the hand's mesh
    ik.pose(q)
    model, data = ik.model, ik.configuration.data
    hand = model.geom("hand")
    start = model.mesh_vertadr[hand.dataid[0]]
    vertices = model.mesh_vert[start : start + model.mesh_vertnum[hand.dataid[0]]]
    lowest = (vertices @ data.geom_xmat[hand.id].reshape(3, 3).T + data.geom_xpos[hand.id])[:, 2].min()
    assert 0.009 < lowest < 0.02


def test_a_solved_pose_is_met_and_its_elbow_does_not_depend_on_the_start(ik: DifferentialIK) -> None:
    T = looking_down([0.42, -0.12, 0.2], 0.7)
    q = solve_pose(panda.Q_HOME, T, ik)
    assert np.linalg.norm(pose_error(ik.pose(q), T)) < 1e-5
    other = solve_pose(solve_pose(panda.Q_HOME, looking_down([0.55, 0.2, 0.4], -0.8), ik), T, ik)
    np.testing.assert_allclose(other, q, atol=0.02)


def test_solving_leaves_a_running_motion_undisturbed() -> None:
    runs = []
    for disturbed in (False, True):
        ik = DifferentialIK()
        q = random_q(3)
        T = ik.pose(q)
        for k in range(50):
            T = integrate_pose(T, np.array([0.05, 0.05, 0, 0, 0, 0.2]), DT)
            if disturbed and k == 25:
                ik.solve(q, looking_down([0.5, 0.0, 0.1]))
            q = q + ik.step(q, T, DT).dq * DT
        runs.append(q)
    np.testing.assert_array_equal(runs[0], runs[1])


def test_a_pose_out_of_reach_is_an_error(ik: DifferentialIK) -> None:
    with pytest.raises(ConfigError, match="out of reach"):
        solve_pose(panda.Q_HOME, looking_down([1.0, 0.0, 0.4]), ik)


@pytest.mark.parametrize(
    "bad",
    [{"damping": -1.0}, {"velocity_fraction": 0.0}, {"collision_distance": 0.2}, {"posture_smoothing": 0}],
)
def test_unusable_settings_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        IkConfig(**bad)  # type: ignore[arg-type]
