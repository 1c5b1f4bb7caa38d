"""Limits and home posture of the Franka Emika Robot (FER, "Panda"), for whoever needs them without MuJoCo.

They are those for Panda in https://frankaemika.github.io/docs/control_parameters.html; the constants in
current libfranka are the FR3's and differ.
"""

from __future__ import annotations

import numpy as np

from mpgrasp.geometry import FloatArray


def _constant(*values: float) -> FloatArray:
    array = np.array(values)
    array.flags.writeable = False
    return array


Q_HOME = _constant(0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4)
"""(7,) [rad]: tool down, camera on the side away from the base."""
Q_MIN = _constant(-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973)
"""(7,) [rad]"""
Q_MAX = _constant(2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973)
"""(7,) [rad]"""
DQ_MAX = _constant(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61)
"""(7,) [rad/s]"""
DDQ_MAX = _constant(15, 7.5, 10, 12.5, 15, 20, 20)
"""(7,) [rad/s2]"""
CARTESIAN_SPEED_MAX = 1.7
"""Translation of the tool [m/s]."""
