"""Detectors before a scene of the benchmark, and their training cards: `python -m mpgrasp.detectors`."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpgrasp.command_line import run_command
from mpgrasp.exceptions import ConfigError, OutputError

if TYPE_CHECKING:
    from mpgrasp.depth import DepthFrame
    from mpgrasp.detectors.detector import GraspDetector
    from mpgrasp.episode.episode import Episode
    from mpgrasp.grasp import GraspMap
    from mpgrasp.height_map import HeightMap
    from mpgrasp.inspection.pictures import DetectorView

EXIT_DISAGREEMENT = 1

_REPEATS = 5  # predictions that are timed once a detector is warm
_MAX_HEIGHT = 1.0  # [m]


@dataclass(frozen=True, kw_only=True)
class View:
    """Where the camera stands: in an episode of a suite, looking straight down."""

    suite: str = "thin"
    seed: int = 0
    """Of the benchmark run."""
    episode: int = 0
    """Number of the episode in that run, from 0."""
    height: float = 0.5
    """Of the tool point over the table [m]."""
    above: str | None = None
    """Object that the camera is over, "" for the scene's first; None for the episode's start pose."""
    camera: str = "auto"
    """auto, gl or ray."""
    noise: bool = True
    """Whether the depth camera is as noisy as a D435."""

    def __post_init__(self) -> None:
        if not 0 < self.height <= _MAX_HEIGHT:
            raise ConfigError(
                "height out of range [m]", got=self.height, allowed=f"above 0, up to {_MAX_HEIGHT}"
            )

    def caption(self) -> list[str]:
        """Four short lines that say which view it is."""
        return [self.suite, f"seed {self.seed}", f"episode {self.episode}", f"tool at {self.height:g} m"]


def look(view: View, detectors: Mapping[str, GraspDetector]) -> tuple[DepthFrame, list[DetectorView]]:
    """The frame that an episode's first look has from that height, and what each detector makes of it.

    Raises:
        ConfigError: a suite, object or height that cannot be used.
        CameraError: a camera backend that this machine does not have.
    """
    from mpgrasp.episode.episode import Episode
    from mpgrasp.suite import episode_seed, load_suite

    suite = load_suite(view.suite)
    seed = episode_seed(suite.name, view.seed, view.episode)
    config = replace(suite.episode_config(camera=view.camera, noise=view.noise), start_height=view.height)
    jury = _Jury(detectors)
    episode = Episode(suite.scene_config(view.episode), seed, detector=jury, config=config)
    try:
        if view.above is not None:
            _move_above(episode, view.above, view.height)
        episode.look()
        assert episode.frame is not None
        return episode.frame, jury.views
    finally:
        episode.close()


class _Jury:
    """All detectors as one, so that they share an episode's frame, noise included."""

    name = "all"

    def __init__(self, detectors: Mapping[str, GraspDetector]) -> None:
        self.detectors = detectors
        self.views: list[DetectorView] = []

    @property
    def reads_truth(self) -> bool:
        from mpgrasp.detectors.detector import reads_truth

        return any(reads_truth(detector) for detector in self.detectors.values())

    @property
    def reads_colour(self) -> bool:
        from mpgrasp.detectors.detector import reads_colour

        return any(reads_colour(detector) for detector in self.detectors.values())

    def reset(self, truth: HeightMap | None) -> None:
        from mpgrasp.detectors.detector import reads_truth

        for detector in self.detectors.values():
            detector.reset(truth if reads_truth(detector) else None)

    def predict(self, frame: DepthFrame) -> GraspMap:
        self.views = [timed_view(name, detector, frame) for name, detector in self.detectors.items()]
        return self.views[0].grasp_map


def timed_view(name: str, detector: GraspDetector, frame: DepthFrame) -> DetectorView:
    """What a detector makes of a frame, and how long it takes when cold and when warm."""
    from mpgrasp.inspection.pictures import DetectorView

    milliseconds = []
    for _ in range(1 + _REPEATS):
        clock = time.perf_counter()
        grasp_map = detector.predict(frame)
        milliseconds.append(1e3 * (time.perf_counter() - clock))
    return DetectorView(
        name=name,
        grasp_map=grasp_map,
        milliseconds=float(np.median(milliseconds[1:])),
        first_milliseconds=milliseconds[0],
    )


def _move_above(episode: Episode, name: str, height: float) -> None:
    """Put the camera over an object, looking straight down, with the tool at that height."""
    from mpgrasp.geometry import invert, looking_down
    from mpgrasp.motion.ik import solve_pose

    name = name or episode.scene.objects[0]
    if name not in episode.scene.objects:
        raise ConfigError("no such object in this scene", got=name, allowed=episode.scene.objects)
    simulation = episode.simulation
    T_tcp_camera = invert(simulation.T_world_tcp) @ episode.camera.pose(simulation.data)
    T = looking_down([*simulation.object_pose(name)[:2, 3], height])
    T[:2, 3] -= (T[:3, :3] @ T_tcp_camera[:3, 3])[:2]
    simulation.set_q(solve_pose(simulation.q, T))


def card(name: str, weights: Path | None) -> dict[str, Any]:
    """What is known about a detector's weights: what network, made from what, with what success.

    Raises:
        ConfigError: a detector without weights of its own.
        WeightsError: a file that is missing, unreadable or another network's.
    """
    from mpgrasp.paths import WEIGHTS
    from mpgrasp.plugins import load_detector

    loaded: Any = getattr(load_detector(name, weights, "torch"), "weights", None)
    if not hasattr(loaded, "card"):
        raise ConfigError("a detector without a training card", got=name, allowed="a network, such as dhrnet")
    return {
        "network": loaded.name,
        "file": str(weights or WEIGHTS / f"{name}.safetensors"),
        "parameters": sum(p.numel() for p in loaded.network.parameters()),
        "settings": dict(loaded.settings),
        "input": vars(loaded.input),
        "width_px": loaded.width_px,
        "training": dict(loaded.card),
    }


def _run_show(options: argparse.Namespace) -> None:
    from PIL import Image

    from mpgrasp.detectors.detector import prepare
    from mpgrasp.inspection.pictures import side_by_side
    from mpgrasp.plugins import load_detector, parse_weights
    from mpgrasp.recording.recorder import claim_file

    names = options.detector.split(",")
    if not all(names) or len(set(names)) < len(names):
        raise ConfigError("unusable list of detectors", got=options.detector, allowed="different detectors")
    view = View(
        suite=options.suite,
        seed=options.seed,
        episode=options.episode,
        height=options.height,
        above=options.above_object,
        camera=options.camera,
        noise=not options.no_noise,
    )
    weights = parse_weights(options.weights, names)
    detectors = {name: load_detector(name, weights.get(name), options.runtime) for name in names}
    for line in filter(None, map(prepare, detectors.values())):
        print(line)
    frame, views = look(view, detectors)
    picture = side_by_side(frame, views, view.caption())
    try:
        Image.fromarray(picture).save(claim_file(options.out, (".png",)), optimize=True)
    except OSError as error:
        raise OutputError(f"a picture cannot be written: {error}", got=str(options.out)) from error
    for shown in views:
        name, *rest = shown.lines()
        print(f"{name}: {', '.join(rest).replace(',  ', ', ')}; first call {shown.first_milliseconds:.0f} ms")
    print(f"Picture: {options.out}")


def _run_check(options: argparse.Namespace) -> int:
    from mpgrasp.detectors.network_detector import NetworkDetector
    from mpgrasp.detectors.runtimes.runtime import TorchRuntime
    from mpgrasp.inspection.runtime_check import MAX_ANGLE, MAX_DISTANCE, compare, rendered_frames
    from mpgrasp.plugins import load_detector

    detector = load_detector(options.detector, options.weights, options.runtime)
    if not isinstance(detector, NetworkDetector):
        raise ConfigError("a detector without a runtime", got=options.detector, allowed="a network's name")
    frames = list(
        rendered_frames(
            options.suite,
            options.frames,
            options.seed,
            camera=options.camera,
            colour=detector.reads_colour,
        )
    )
    detector.warm_up()
    print(detector.readiness)
    plain = NetworkDetector(detector.weights, runtime=TorchRuntime(detector.weights, plain=True))
    found = compare(detector, plain, frames)
    fast, slow = found.milliseconds
    print(
        f"top grasp within {MAX_DISTANCE:g} px and {np.rad2deg(MAX_ANGLE):g} degrees of plain torch on"
        f" {found.same} of {len(frames)} frames ({100 * found.share:.1f} %);"
        f" {fast:.1f} ms a frame, plain torch {slow:.1f} ms"
    )
    return 0 if found.good else EXIT_DISAGREEMENT


def _print_card(about: Mapping[str, Any], indent: str = "") -> None:
    for key, value in about.items():
        if isinstance(value, Mapping) and value:
            print(f"{indent}{key}:")
            _print_card(value, indent + "  ")
        else:
            print(f"{indent}{key}: {value if isinstance(value, str) else json.dumps(value, default=str)}")


def main(parser: argparse.ArgumentParser, command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given), as `parser` reads it, and return the exit code."""
    # before torch is loaded: times are those of one thread, as in the benchmark, unless asked otherwise
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    return run_command(lambda: _run(parser.parse_args(command)))


def _run(options: argparse.Namespace) -> int:
    if options.command == "check":
        return _run_check(options)
    if options.command == "show":
        _run_show(options)
    else:
        _print_card(card(options.detector, options.weights))
    return 0
