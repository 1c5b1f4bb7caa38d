"""The protocol of every grasp detector: a depth frame in, a grasp map out.

`GraspDetector` is what each must have, `DetectorExtras` what it may have besides, each by itself; the
functions below say what holds where it has not. Nothing else of a detector is ever called or read.
"""

from __future__ import annotations

from typing import Any, Protocol

from mpgrasp.depth import DepthFrame
from mpgrasp.exceptions import MpgraspError, PlugInError
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap


class GraspDetector(Protocol):
    """Maps a wrist depth frame to a grasp for every pixel of its own crop of that frame."""

    name: str

    def reset(self, truth: HeightMap | None) -> None:
        """Start an episode and forget all before, so that it ends alike in whichever process it is played.

        `truth` is the true shape for a detector that `reads_truth`, else None.
        """
        ...

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Return the grasp map of the frame; quality is zero everywhere where the image says nothing."""
        ...


class DetectorExtras(Protocol):
    """What a detector may have besides."""

    @property
    def reads_truth(self) -> bool:
        """True to be told the scene's true shape in `reset`."""
        ...

    @property
    def reads_colour(self) -> bool:
        """True to get frames with `rgb`."""
        ...

    @property
    def runtime(self) -> str:
        """Engine that computes it, for run.json: "openvino bf16"."""
        ...

    @property
    def device(self) -> str:
        """Device that it is computed on, for run.json: "cpu", "cuda"."""
        ...

    @property
    def config(self) -> Any:
        """Settings, for run.json: a dataclass, or plain values."""
        ...

    @property
    def readiness(self) -> str:
        """One line about `warm_up`: "dhrnet: openvino bf16, ready in 1.3 s (cached)"."""
        ...

    def warm_up(self) -> float:
        """Compile, or whatever the first frame would else wait for; return the time it took [s]."""
        ...


def reads_truth(detector: GraspDetector) -> bool:
    """True if the detector declares, by `reads_truth = True`, that it is told the scene's true shape.

    The benchmark writes it into run.json: such a detector is a ceiling, not a competitor.
    """
    return bool(getattr(detector, "reads_truth", False))


def reads_colour(detector: GraspDetector) -> bool:
    """True if the detector declares, by `reads_colour = True`, that its frames must have colour."""
    return bool(getattr(detector, "reads_colour", False))


def prepare(detector: GraspDetector) -> str | None:
    """Let a detector that compiles something do it now, and return a line that says what it took.

    Such a detector offers `warm_up()`, and may offer `readiness`, the line. None of all others.

    Raises:
        PlugInError: it cannot get ready.
    """
    if not hasattr(detector, "warm_up"):
        return None
    try:
        detector.warm_up()
        return str(getattr(detector, "readiness", "")) or None
    except MpgraspError:
        raise
    except Exception as error:
        name = getattr(detector, "name", type(detector).__name__)
        raise PlugInError(f"detector {name} cannot get ready: {type(error).__name__}: {error}") from error


def runtime_of(detector: GraspDetector) -> str | None:
    """Return the engine that computes a detector, None where it does not say."""
    return getattr(detector, "runtime", None)


def device_of(detector: GraspDetector) -> str | None:
    """Return the device that a detector is computed on, None where it does not say."""
    return getattr(detector, "device", None)
