"""`python -m mpgrasp.detectors check`: does a runtime find the grasps that plain torch finds?"""

from __future__ import annotations

import argparse

import numpy as np

from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.runtimes.torch_runtime import TorchRuntime
from mpgrasp.exceptions import ConfigError
from mpgrasp.inspection.agreement import MAX_ANGLE, MAX_DISTANCE, compare, rendered_frames
from mpgrasp.plugins import load_detector

EXIT_DISAGREEMENT = 1


def run(options: argparse.Namespace) -> int:
    """Compare a runtime's grasps with those of plain torch, and say it in a line; return the exit code."""
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
