"""Figures of a motion are those of the ticks that it was fed with."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.geometry import FloatArray
from mpgrasp.motion.ik_solution import IkSolution
from mpgrasp.motion.motion_statistics import MotionMeter, MotionStatistics
from mpgrasp.motion.trajectory import MotionConfig

DT = MotionConfig().dt
LAG = np.array([0.0, 0.0, 0.002])


def solution(k: int) -> IkSolution:
    """Joint 3 speeds up by 1 rad/s2, and asks for twice as much; the arm comes closer to a singularity."""
    dq = np.zeros(7)
    dq[2] = k * DT
    return IkSolution(dq=dq, demanded_dq=2 * dq, manipulability=0.1, min_singular_value=0.201 - 0.01 * k)


def fed_with(positions: FloatArray, speeds: FloatArray) -> MotionStatistics:
    """Figures after one tick for each position (n, 3) [m], at a speed (n,) along x [m/s]."""
    meter = MotionMeter(MotionConfig(), 3.0, np.zeros(3), 0.2)
    for k, (position, speed) in enumerate(zip(positions, speeds, strict=True), 1):
        twist = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
        meter.observe(twist, solution(k), position, position + LAG, twist[:3])
    assert meter.twist[0] == speeds[-1]
    return meter.statistics(3.0 + len(positions) * DT)


def test_a_way_there_and_back_is_twice_as_long() -> None:
    x = np.concatenate([np.linspace(0.01, 0.1, 10), np.linspace(0.09, 0.0, 10)])
    figures = fed_with(np.column_stack([x, 0 * x, 0 * x]), np.zeros(20))
    assert figures.path_length == pytest.approx(0.2)
    assert figures.duration == pytest.approx(20 * DT)
    assert figures.max_tracking_error == pytest.approx(0.002)


def test_joints_and_singular_values_are_the_worst_of_all_ticks() -> None:
    figures = fed_with(np.zeros((16, 3)), np.zeros(16))
    assert figures.max_joint_acceleration == pytest.approx(np.eye(7)[2])
    assert figures.max_joint_velocity == pytest.approx(2 * 16 * DT * np.eye(7)[2])
    assert figures.min_singular_value == pytest.approx(0.041)
    # below the warning level of 0.05 in the last tick alone
    assert figures.near_singularity == pytest.approx(DT)


def test_a_steady_acceleration_has_no_jerk_and_a_wavering_one_that_of_its_second_difference() -> None:
    t = np.arange(1, 101) * DT
    steady = fed_with(np.zeros((100, 3)), 0.5 * t)
    assert steady.max_acceleration == pytest.approx(0.5)
    assert steady.jerk_rms == pytest.approx(0.0, abs=1e-6)
    w, amplitude = 2 * np.pi * 2.0, 0.05
    wavering = fed_with(np.zeros((100, 3)), amplitude * np.sin(w * t))
    # second derivative of the speed over whole periods
    assert wavering.jerk_rms == pytest.approx(amplitude * w**2 / np.sqrt(2), rel=0.02)
