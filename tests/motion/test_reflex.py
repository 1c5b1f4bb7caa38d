"""Protective stops name the limit that was broken, latch, and stay silent otherwise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import rotation_z, transform
from mpgrasp.motion.ik_solution import IkSolution
from mpgrasp.motion.reflex import UNITS, MeasuredArm, Reflex, ReflexConfig, ReflexMonitor
from mpgrasp.robot import panda


def one(joint: int, value: float) -> np.ndarray:
    array = np.zeros(7)
    array[joint - 1] = value
    return array


def solution(**changes: Any) -> IkSolution:
    values: dict[str, Any] = {
        "dq": np.zeros(7), "demanded_dq": np.zeros(7), "manipulability": 0.1, "min_singular_value": 0.2,
    }  # fmt: skip
    return IkSolution(**(values | changes))


def check(monitor: ReflexMonitor, **changes: Any) -> Reflex | None:
    measured: dict[str, Any] = {
        "time": 1.0, "q": np.array(panda.Q_HOME), "dq": np.zeros(7), "twist": np.zeros(6),
        "T_world_tcp": np.eye(4), "contact_force": 0.0,
    }  # fmt: skip
    wanted = changes.pop("solution", None) or solution()
    return monitor.check(MeasuredArm(**(measured | changes)), wanted, np.eye(4), 0.01)


def test_rest_trips_nothing() -> None:
    assert check(ReflexMonitor()) is None


@pytest.mark.parametrize(
    ("changes", "limit", "joint", "value"),
    [
        ({"q": panda.Q_HOME + one(4, 3.0)}, "joint_position", 4, panda.Q_HOME[3] + 3.0),
        ({"dq": one(2, -2.2)}, "joint_velocity", 2, -2.2),
        ({"solution": solution(demanded_dq=one(6, 2.7))}, "joint_velocity", 6, 2.7),
        ({"solution": solution(dq=one(2, 0.08))}, "joint_acceleration", 2, 8.0),
        ({"solution": solution(feasible=False)}, "ik_infeasible", None, 1.0),
        ({"twist": np.array([0, 1.8, 0, 0, 0, 0])}, "cartesian_velocity", None, 1.8),
        ({"twist": np.array([0, 0, 0, 0, 0, -2.6])}, "cartesian_rotation", None, 2.6),
        ({"T_world_tcp": transform(np.eye(3), [0.03, 0, 0])}, "tracking_position", None, 0.03),
        ({"T_world_tcp": transform(rotation_z(0.2), [0, 0, 0])}, "tracking_orientation", None, 0.2),
        ({"contact_force": 110.0}, "contact_force", None, 110.0),
        (
            {"solution": solution(residual=0.01, blocked="joint_position", blocked_joint=7,
                                  blocked_value=2.887,
                                  blocked_bound=2.8873)},
            "joint_position", 7, 2.887,
        ),
        (
            {"solution": solution(residual=0.01, blocked="collision_avoidance", blocked_value=0.0101,
                                  blocked_bound=0.01)},
            "collision_avoidance", None, 0.0101,
        ),
        ({"solution": solution(residual=0.01)}, "tracking_position", None, 0.01),
        ({"solution": solution(residual_angle=0.05)}, "tracking_orientation", None, 0.05),
    ],
)  # fmt: skip
def test_a_stop_names_limit_joint_value_and_bound(
    changes: dict[str, Any], limit: str, joint: int | None, value: float
) -> None:
    reflex = check(ReflexMonitor(), **changes)
    assert reflex is not None
    assert (reflex.limit, reflex.joint) == (limit, joint)
    assert reflex.value == pytest.approx(value)
    assert limit in UNITS
    assert limit in str(reflex)
    assert "bound" in str(reflex)


@pytest.mark.parametrize(("limit", "bound"), [("joint_position", 2.8873), ("joint_velocity", 2.61)])
def test_joints_that_jump_because_another_is_at_its_limit_are_not_named_for_it(
    limit: str, bound: float
) -> None:
    leaning = solution(
        dq=one(3, 0.4), blocked=limit, blocked_joint=7, blocked_value=bound, blocked_bound=bound
    )
    reflex = check(ReflexMonitor(), solution=leaning)
    assert reflex is not None
    assert (reflex.limit, reflex.joint, reflex.bound) == (limit, 7, bound)


def test_a_joint_at_its_limit_that_makes_no_other_jump_stops_nothing() -> None:
    leaning = solution(
        dq=one(3, 0.05), blocked="joint_position", blocked_joint=7, blocked_value=2.887, blocked_bound=2.8873
    )
    assert check(ReflexMonitor(), solution=leaning) is None


@pytest.mark.parametrize("joint", [1, 4, 7])
def test_a_joint_may_be_at_either_end_of_its_range_and_is_told_the_end_that_it_has_left(joint: int) -> None:
    config = ReflexConfig()
    for bound, way in ((config.q_min[joint - 1], -1.0), (config.q_max[joint - 1], 1.0)):
        at_the_end = np.array(panda.Q_HOME)
        at_the_end[joint - 1] = bound
        assert check(ReflexMonitor(config), q=at_the_end) is None
        reflex = check(ReflexMonitor(config), q=at_the_end + one(joint, way * 0.01))
        assert reflex is not None
        assert (reflex.limit, reflex.bound, reflex.demanded) == ("joint_position", bound, False)


def test_a_turn_is_measured_by_the_rotation_alone() -> None:
    bounds = ReflexConfig(cartesian_velocity=2.0, cartesian_rotation=1.0)
    assert check(ReflexMonitor(bounds), twist=np.array([0, 0, 1.9, 0, 0, 0.9])) is None
    assert check(ReflexMonitor(bounds), twist=np.array([2.0, 0, 0, 0, 1.0, 0])) is None  # at both bounds
    reflex = check(ReflexMonitor(bounds), solution=solution(feasible=False))
    assert reflex is not None
    assert (reflex.value, reflex.bound) == (1.0, 0.0)  # of none feasible, one asked


def test_a_stop_reads_well() -> None:
    reflex = Reflex(limit="joint_velocity", joint=4, value=2.31, bound=2.175, time=3.4)
    assert str(reflex) == "joint_velocity: joint 4 at 2.31 rad/s, bound 2.175 rad/s, t = 3.40 s"


def test_values_just_within_the_bounds_trip_nothing() -> None:
    monitor = ReflexMonitor()
    dq = 0.999 * panda.DQ_MAX
    step = 0.999 * panda.DDQ_MAX * 0.01
    for k in range(5):
        assert check(monitor, dq=dq, solution=solution(dq=step * (k + 1), demanded_dq=dq)) is None


def test_the_first_violation_latches_until_reset() -> None:
    monitor = ReflexMonitor()
    first = check(monitor, contact_force=200.0)
    assert check(monitor, dq=one(1, 9.0), time=2.0) is first
    monitor.reset()
    assert check(monitor) is None


@pytest.mark.parametrize("name", ["residual", "residual_angle"])
def test_what_ik_cannot_follow_is_a_demand_and_no_measurement(name: str) -> None:
    reflex = check(ReflexMonitor(), solution=solution(**{name: 0.05}))
    assert reflex is not None
    assert reflex.demanded


def test_a_turn_may_be_as_fast_as_the_arms_maker_says() -> None:
    for speed, stops in ((2.49, False), (2.51, True)):
        reflex = check(ReflexMonitor(), twist=np.array([0, 0, 0, 0, 0, speed]))
        assert (reflex is not None) is stops


def test_a_velocity_that_is_not_a_number_is_a_violation() -> None:
    reflex = check(ReflexMonitor(), dq=one(3, np.nan))
    assert reflex is not None
    assert (reflex.limit, reflex.joint) == ("joint_velocity", 3)


@pytest.mark.parametrize(
    "bad",
    [
        {"contact_force": 0.0},
        {"dq_max": np.ones(6)},
        {"dq_max": np.ones(8)},
        {"q_min": np.full(7, 9.0)},
        {"q_min": panda.Q_MAX},
        {"ik_residual": -1.0},
    ],
)
def test_unusable_bounds_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        ReflexConfig(**bad)
