"""Ramps and profiles that keep ordinary motion clear of protective stops, and steps of poses."""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, rotation_vector, transform
from mpgrasp.linear_algebra import norm, product

DT = (0.002, 0.05)
"""Shortest and longest period of the velocity loop [s]: a step of the simulation, and 20 Hz."""


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """Speeds and accelerations of the arm's motion, and the level at which a singularity counts as near."""

    dt: float = 0.01
    """Period of the velocity loop [s]."""
    linear_acceleration: float = 1.0
    """[m/s2]. A reversal of 0.1 m/s then takes 0.25 s and uses less than half of any joint's acceleration
    within the workspace."""
    angular_acceleration: float = 4.0
    """[rad/s2]"""
    smoothing: int = 5
    """Ticks over which the ramped velocity is averaged: bounds the jerk at 2 a / (smoothing dt)."""
    max_speed: float = 0.25
    """Speed of pose moves [m/s]."""
    max_rotation: float = 1.5
    """Rotation of pose moves [rad/s]."""
    joint_fraction: float = 0.8
    """Share of the FER's joint velocity and acceleration that a pose move may use; where it would need
    more it slows down. Ordinary moves within the workspace use less than 0.7; what is left covers the
    elbow's swing home, which is not planned."""
    max_slowdown: float = 8.0
    """The most by which a pose move slows down; what needs more ends in a protective stop."""
    singularity_warning: float = 0.05
    """Smallest singular value of the tool Jacobian (m, rad) below which time counts as near a singularity.
    At the controllers' 0.1 m/s a value of 0.046 = 0.1 / 2.175 is where the worst direction uses up a
    joint's velocity; the workspace (`workspace.WORKSPACE_REACH`) stays above 0.12, and the value
    falls through 0.05 at 0.76 to 0.79 m from the base, some 2 cm before the arm is stretched."""

    def __post_init__(self) -> None:
        for name in (
            "dt", "linear_acceleration", "angular_acceleration", "max_speed", "max_rotation",
            "singularity_warning",
        ):  # fmt: skip
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be positive", got=getattr(self, name))
        if not DT[0] <= self.dt <= DT[1]:
            raise ConfigError("dt out of range", got=self.dt, allowed=f"{DT[0]:g} to {DT[1]:g} [s]")
        if not 0 < self.joint_fraction <= 1:
            raise ConfigError("joint_fraction is a share", got=self.joint_fraction, allowed="(0, 1]")
        if not self.max_slowdown >= 1:
            raise ConfigError("max_slowdown is a factor", got=self.max_slowdown, allowed="1 or more")
        if self.smoothing < 1:
            raise ConfigError("smoothing counts ticks", got=self.smoothing, allowed="1 or more")


class TwistRamp:
    """Follows a wanted twist with bounded acceleration and jerk, without overshoot.

    A rate limiter bounds the acceleration; the mean of its last `smoothing` values bounds the jerk and
    cannot exceed the acceleration of what it averages.
    """

    def __init__(self, config: MotionConfig | None = None) -> None:
        self.config = config or MotionConfig()
        self.reset()

    def reset(self, twist: FloatArray | None = None) -> None:
        """Start from a constant twist (6,); at rest by default."""
        start = np.zeros(6) if twist is None else np.array(twist, float)
        self._limited = start
        self._recent = deque([start] * self.config.smoothing, maxlen=self.config.smoothing)

    @property
    def twist(self) -> FloatArray:
        """The ramped twist (6,) of the last tick [m/s, rad/s]."""
        return mean_of(self._recent)

    def step(self, wanted: FloatArray) -> FloatArray:
        """The twist (6,) of the next tick on the way to `wanted` (6,)."""
        c = self.config
        step = np.asarray(wanted, float) - self._limited
        for part, bound in ((slice(0, 3), c.linear_acceleration), (slice(3, 6), c.angular_acceleration)):
            length = norm(step[part])
            if length > bound * c.dt:
                step[part] *= bound * c.dt / length
        self._limited = self._limited + step
        self._recent.append(self._limited)
        return self.twist


def mean_of(vectors: Collection[FloatArray]) -> FloatArray:
    """Mean (n,) of a few vectors (n,); `numpy.mean` takes several times as long for so little."""
    return functools.reduce(np.add, vectors) / len(vectors)


def path_profile(
    length: float, angle: float, config: MotionConfig, speed: float, rotation: float, slowdown: float = 1.0
) -> FloatArray:
    """Shares of a straight-line move after each tick, (n,), from just above 0 to 1.

    A trapezoid of velocity, smoothed as `TwistRamp` does, that keeps both the linear and the angular
    bounds of speed and acceleration.

    Args:
        length: of the move [m].
        angle: of the move [rad].
        config: accelerations, period and smoothing.
        speed: bound [m/s].
        rotation: bound [rad/s].
        slowdown: how many times as long the move takes as these bounds would let it; 1 or more.
    """
    if length < 1e-9 and angle < 1e-9:
        return np.empty(0)
    v = min(speed / max(length, 1e-9), rotation / max(angle, 1e-9))  # share per second
    a = min(config.linear_acceleration / max(length, 1e-9), config.angular_acceleration / max(angle, 1e-9))
    v = min(v, np.sqrt(a)) / slowdown  # a short move is a triangle
    a /= slowdown**2
    duration = 1.0 / v + v / a
    t = np.arange(config.dt, duration + config.dt, config.dt)
    ramp = np.clip(np.minimum(a * t, a * (duration - t)), 0.0, v)
    velocity = np.zeros(len(ramp) + config.smoothing - 1)
    for delay in range(config.smoothing):  # np.convolve would ask BLAS
        velocity[delay : delay + len(ramp)] += ramp / config.smoothing
    share = np.cumsum(velocity)
    if share[-1] <= 0:
        return np.ones(1)  # a move so short that it fits into one tick
    return np.asarray(share / share[-1])


def shake_offset(t: float, amplitude: float, frequency: float, duration: float) -> float:
    """Offset [m] at time t [s] of an oscillation [Hz] that swells and fades, at rest at both ends."""
    return float(amplitude * np.sin(np.pi * t / duration) ** 2 * np.sin(2 * np.pi * frequency * t))


def pose_error(T_from: FloatArray, T_to: FloatArray) -> FloatArray:
    """Twist (6,), world axes, that carries one pose into the other within one second [m, rad]."""
    rotation = rotation_vector(product(T_to[:3, :3], T_from[:3, :3].T))
    return np.concatenate([T_to[:3, 3] - T_from[:3, 3], rotation])


def integrate_pose(T: FloatArray, twist: FloatArray, dt: float) -> FloatArray:
    """Pose (4, 4) after moving with `twist` (6,), world axes [m/s, rad/s], for dt [s]."""
    return transform(product(_rotation(twist[3:] * dt), T[:3, :3]), T[:3, 3] + twist[:3] * dt)


def _rotation(turn: FloatArray) -> FloatArray:
    """Rotation (3, 3) about an axis by its length (3,) [rad]; Rodrigues' formula."""
    x, y, z = turn.tolist()
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    a, b = (math.sin(angle) / angle, (1 - math.cos(angle)) / square) if angle > 1e-8 else (1.0, 0.5)
    return np.array(
        [
            [1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)],
        ]
    )
