"""A look at a scene of the benchmark through the eyes of several detectors."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import GraspDetector, reads_colour, reads_truth
from mpgrasp.episode.episode import Episode
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import GraspMap
from mpgrasp.guards.asking import ask_detector
from mpgrasp.height_map import HeightMap
from mpgrasp.inspection.pictures import Prediction
from mpgrasp.suite import Suite, episode_seed, load_suite

_REPEATS = 5  # predictions that are timed once a detector is warm
_MAX_HEIGHT = 1.0  # [m]


@dataclass(frozen=True, kw_only=True)
class Viewpoint:
    """Place of the camera: in an episode of a suite, looking straight down."""

    suite: Suite = field(default_factory=lambda: load_suite("thin"))
    seed: int = 0
    """Seed of the benchmark run."""
    episode: int = 0
    """Number of the episode in that run, from 0."""
    height: float = 0.5
    """Height of the tool point over the table [m]."""
    above: str | None = None
    """Object that the camera is over, "" for the scene's first; None for the episode's start pose."""
    camera: str = "auto"
    """auto, gl or ray."""
    noise: bool = True
    """True for a depth camera as noisy as a D435."""

    def __post_init__(self) -> None:
        if not 0 < self.height <= _MAX_HEIGHT:
            raise ConfigError(
                "height out of range [m]", got=self.height, allowed=f"above 0, up to {_MAX_HEIGHT}"
            )

    def caption(self) -> list[str]:
        """Return four short lines that name the place."""
        return [self.suite.name, f"seed {self.seed}", f"episode {self.episode}", f"tool at {self.height:g} m"]


def look(viewpoint: Viewpoint, detectors: Mapping[str, GraspDetector]) -> tuple[DepthFrame, list[Prediction]]:
    """Return the frame of an episode's first look from there, and what each detector makes of it.

    Raises:
        ConfigError: an object or height that cannot be used.
        CameraError: a camera backend that this machine does not have.
    """
    suite = viewpoint.suite
    seed = episode_seed(suite.name, viewpoint.seed, viewpoint.episode)
    config = replace(
        suite.episode_config(camera=viewpoint.camera, noise=viewpoint.noise), start_height=viewpoint.height
    )
    panel = _Panel(detectors)
    episode = Episode(suite.scene_config(viewpoint.episode), seed, detector=panel, config=config)
    try:
        if viewpoint.above is not None:
            _move_above(episode, viewpoint.above, viewpoint.height)
        episode.look()
        assert episode.frame is not None
        return episode.frame, panel.predictions
    finally:
        episode.close()


class _Panel:
    """All detectors as one, so that they share an episode's frame, noise included."""

    name = "all"

    def __init__(self, detectors: Mapping[str, GraspDetector]) -> None:
        self.detectors = detectors
        self.predictions: list[Prediction] = []

    @property
    def reads_truth(self) -> bool:
        return any(reads_truth(detector) for detector in self.detectors.values())

    @property
    def reads_colour(self) -> bool:
        return any(reads_colour(detector) for detector in self.detectors.values())

    def reset(self, truth: HeightMap | None) -> None:
        for detector in self.detectors.values():
            detector.reset(truth if reads_truth(detector) else None)

    def predict(self, frame: DepthFrame) -> GraspMap:
        self.predictions = [
            timed_prediction(name, detector, frame) for name, detector in self.detectors.items()
        ]
        return self.predictions[0].grasp_map


def timed_prediction(name: str, detector: GraspDetector, frame: DepthFrame) -> Prediction:
    """Return what a detector makes of a frame, and how long it takes when cold and when warm."""
    milliseconds = []
    for _ in range(1 + _REPEATS):
        clock = time.perf_counter()
        grasp_map = ask_detector(detector, frame)
        milliseconds.append(1e3 * (time.perf_counter() - clock))
    return Prediction(
        name=name,
        grasp_map=grasp_map,
        milliseconds=float(np.median(milliseconds[1:])),
        first_milliseconds=milliseconds[0],
    )


def _move_above(episode: Episode, name: str, height: float) -> None:
    """Put the camera over an object, looking straight down, with the tool at that height."""
    name = name or episode.scene.objects[0]
    if name not in episode.scene.objects:
        raise ConfigError("no such object in this scene", got=name, allowed=episode.scene.objects)
    episode.world.put_camera_above(episode.simulation.object_pose(name)[:2, 3], height)
