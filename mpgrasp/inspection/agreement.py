"""Agreement of a runtime's grasps with those of plain torch, over rendered images of a suite's scenes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import CROP, DepthFrame
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import GraspMap, best_pixel
from mpgrasp.scene.scene import build_scene
from mpgrasp.suite import episode_seed, load_suite

if TYPE_CHECKING:
    from mpgrasp.detectors.network_detector import NetworkDetector

MAX_DISTANCE = 2.0
"""Distance between the pixels of two top grasps that count as the same [px]."""
MAX_ANGLE = np.deg2rad(3.0)
"""Angle between their closing directions [rad]."""
MIN_SHARE = 0.95
"""Share of frames with the same top grasp in a runtime that may be used."""

_VIEWS = 4  # of each scene
_CAMERA_HEIGHT = (0.22, 0.56)  # [m], from MP-PC's last look to its first
_OFFSET = 0.04  # [m], of the camera from the object that it is over, at most
_STREAM = 31  # of the seed, beside those of scene and episode


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Distance of the top grasps of two detectors, frame by frame, and time that a frame costs."""

    distance: FloatArray
    """(n,) distance [px]; infinite where only one of them found a grasp."""
    angle: FloatArray
    """(n,) angle between the closing directions [rad]."""
    milliseconds: tuple[float, float]
    """Median of one `predict`, of each of the two [ms]."""

    @property
    def same(self) -> int:
        """Number of frames with the same top grasp."""
        return int(((self.distance <= MAX_DISTANCE) & (self.angle <= MAX_ANGLE)).sum())

    @property
    def share(self) -> float:
        """Share of frames with the same top grasp."""
        return self.same / len(self.distance)

    @property
    def good(self) -> bool:
        """True if that share is enough."""
        return self.share >= MIN_SHARE


def rendered_frames(
    suite: str, count: int, seed: int = 0, *, camera: str = "auto", colour: bool = False
) -> Iterator[DepthFrame]:
    """Render noisy images of a suite's scenes from over an object, at heights of the closed loop.

    Raises:
        ConfigError: a suite or number that cannot be used.
        CameraError: a camera backend that this machine does not have.
    """
    if count < 1:
        raise ConfigError("unusable number of frames", got=count, allowed="1 or more")
    declared = load_suite(suite)
    for first in range(0, count, _VIEWS):
        number = first // _VIEWS
        scene_seed = episode_seed(declared.name, seed, number)
        scene = build_scene(declared.scene_config(number), scene_seed, robot=False)
        rng = np.random.default_rng([scene_seed, _STREAM])
        data = scene.data()
        eye = WristCamera(scene.model, camera, crop=CROP, colour=colour)
        try:
            for _ in range(min(_VIEWS, count - first)):
                target = data.body(str(rng.choice(scene.objects))).xpos[:2]
                offset = rng.uniform(-_OFFSET, _OFFSET, 2)
                pose = looking_down(
                    [*(target + offset), rng.uniform(*_CAMERA_HEIGHT)], rng.uniform(-np.pi, np.pi)
                )
                yield eye.render(data, pose, rng)
        finally:
            eye.close()


def compare(detector: NetworkDetector, reference: NetworkDetector, frames: Sequence[DepthFrame]) -> Agreement:
    """Compare what two detectors, asked in turn, make of the same frames."""
    apart, times = [], []
    for detected in (detector, reference):
        detected.warm_up()
    for frame in frames:
        maps, clocks = [], [time.perf_counter()]
        for detected in (detector, reference):
            maps.append(detected.predict(frame))
            clocks.append(time.perf_counter())
        apart.append(grasps_apart(*maps))
        times.append(np.diff(clocks))
    distance, angle = np.array(apart).T
    fast, slow = 1e3 * np.median(times, axis=0)
    return Agreement(distance=distance, angle=angle, milliseconds=(float(fast), float(slow)))


def grasps_apart(first: GraspMap, second: GraspMap) -> tuple[float, float]:
    """Return the distance [px] and angle [rad] between the top grasps of two maps of one image."""
    found = [bool(grasp_map.quality.any()) for grasp_map in (first, second)]
    if not all(found):
        return (np.inf, np.pi / 2) if any(found) else (0.0, 0.0)
    a, b = best_pixel(first.quality), best_pixel(second.quality)
    return float(np.hypot(a[0] - b[0], a[1] - b[1])), float(
        line_angle_difference(first.angle[a], second.angle[b])
    )
