"""Settings of an episode, whatever the detector and the controller: one grasp, or a table to be cleared."""

from __future__ import annotations

from dataclasses import dataclass, field

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.camera.config import CameraConfig
from mpgrasp.camera.noise import DepthNoise
from mpgrasp.exceptions import ConfigError
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.ik_config import IkConfig
from mpgrasp.motion.reflex import ReflexConfig
from mpgrasp.motion.trajectory import MotionConfig

FER_REFLEXES = ReflexConfig()
"""Bounds of the FER: one object, because configs that hold arrays are equal only to themselves."""

_RANGES = {
    "control_dt": (0.002, 2.0),
    "start_height": (0.05, 1.0),
    "max_reach_time": (0.1, 3600.0),
    "start_jitter": (0.0, 0.5),
}
"""Least and greatest value of settings, in their units; what lies outside can only be a slip."""


@dataclass(frozen=True, kw_only=True)
class EpisodeConfig:
    """Settings of a single grasp."""

    control_dt: float = 0.1
    """Period of the control tick: image, detection, decision [s]."""
    start_height: float = 0.50
    """Height of the tool point over the table at the start [m], Table I's z_max."""
    start_jitter: float = 0.05
    """Standard deviation of the first viewpoint about the workspace's centre, in x and in y [m]; drawn
    within two standard deviations."""
    start_radius: float | None = None
    """Radius of a disc about the workspace's centre in which the first viewpoint lies, anywhere alike [m], as
    in the paper's Fig. 3; none = as `start_jitter` says. A viewpoint that the arm does not reach is drawn
    again."""
    max_reach_time: float = 20.0
    """A reach that takes longer is a timeout [s]."""
    camera_backend: str = "auto"
    """auto, gl or ray."""
    noise: bool = True
    """True for the errors of `sensor`, False for perfect depth."""
    sensor: DepthNoise = field(default_factory=DepthNoise)
    """Errors of the depth camera."""
    camera: CameraConfig = field(default_factory=CameraConfig)
    """Geometry of its images."""
    execution: ExecutionConfig = field(default_factory=ExecutionConfig)
    """Execution of the chosen grasp, and how it is judged."""
    motion: MotionConfig = field(default_factory=MotionConfig)
    """Speeds and accelerations of the arm."""
    ik: IkConfig = field(default_factory=IkConfig)
    """Differential inverse kinematics."""
    reflex: ReflexConfig = FER_REFLEXES
    """Bounds of the protective stops."""

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            if not low <= getattr(self, name) <= high:
                raise ConfigError(
                    f"{name} out of range", got=getattr(self, name), allowed=f"{low:g} to {high:g}"
                )
        if self.start_radius is not None and not 0 <= self.start_radius <= 0.5:
            raise ConfigError("start_radius", got=self.start_radius, allowed="0 to 0.5 [m], or none")
        if self.camera_backend not in BACKENDS:
            raise ConfigError("unknown camera backend", got=self.camera_backend, allowed=BACKENDS)


@dataclass(frozen=True, kw_only=True)
class ClearingConfig(EpisodeConfig):
    """Settings of a table to be cleared: pick, carry to the basket, drop, return, over and over."""

    time_limit: float = 900.0
    """No attempt begins later than this, and a table that is clear only then counts as a timeout
    [s, simulated]; the slowest of the paper's methods took 721 s."""
    blind_attempts: int = 3
    """So many attempts in a row in which nothing to grasp was found end the episode."""
    recovery_time: float = 5.0
    """Time that a protective stop costs until the arm moves again: the stop is noticed, acknowledged and
    recovered from [s]. Not a figure of the robot, but the same for all."""
    carry_height: float = 0.30
    """Height of the tool point over the table on its way to the basket [m]."""
    drop_height: float = 0.18
    """Height of the tool point over the table at which the hand opens above the basket, unless what it
    holds comes to stand on something before [m]."""
    carry_speed: float = 0.25
    """Speed with an object in the hand [m/s]."""
    lower_speed: float = 0.1
    """Speed on the last part of the way, into the basket [m/s]."""
    drop_time: float = 0.4
    """Time for which the open hand waits above the basket [s]."""
    execution: ExecutionConfig = field(
        default_factory=lambda: ExecutionConfig(hold_time=0.0, shake_time=0.0, settle_after_shake=0.0)
    )
    """Execution of each grasp: carrying takes the place of hold and shake."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("time_limit", "carry_height", "drop_height", "carry_speed", "lower_speed"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be positive", got=getattr(self, name))
        for name in ("recovery_time", "drop_time"):
            if not getattr(self, name) >= 0:
                raise ConfigError(f"{name} must not be negative", got=getattr(self, name))
        if self.blind_attempts < 1:
            raise ConfigError("blind_attempts counts attempts", got=self.blind_attempts, allowed="1 or more")
