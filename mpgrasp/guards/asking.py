"""Asks a detector or a controller, and hands on what it answers only once that is known to be usable.

Every run asks through these: `run_episode`, `run_clearing`, `GraspEnv` and the benchmark.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from mpgrasp.controllers.controller import Command, Controller, Observation
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.exceptions import PlugInError
from mpgrasp.foreign_code import working_directory
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.guards.command import check_command, check_diagnostics, check_final_grasp
from mpgrasp.guards.grasp_map import check_grasp_map
from mpgrasp.guards.words import owner


def ask_detector(detector: GraspDetector, frame: DepthFrame) -> GraspMap:
    """Return a detector's map of a frame.

    Raises:
        PlugInError: a map that cannot be used, or a detector that changed the working directory.
    """
    name = owner("detector", detector)
    with same_directory(name):
        answer = detector.predict(frame)
    return check_grasp_map(answer, frame, name)


def ask_controller(controller: Controller, observation: Observation) -> Command:
    """Return a controller's command after an observation.

    Raises:
        PlugInError: a command that cannot be used, or a controller that changed the working directory.
    """
    name = owner("controller", controller)
    with same_directory(name):
        answer = controller.update(observation)
    return check_command(answer, name)


def ask_final_grasp(controller: Controller) -> Grasp | None:
    """Return the grasp that a controller has chosen, or None for none.

    Raises:
        PlugInError: a grasp that cannot be used.
    """
    return check_final_grasp(controller.final_grasp(), owner("controller", controller))


def ask_diagnostics(controller: Controller) -> Mapping[str, FloatArray | float | bool]:
    """Return what a controller shows for recordings.

    Raises:
        PlugInError: no mapping by name.
    """
    return check_diagnostics(controller.diagnostics(), owner("controller", controller))


@contextmanager
def same_directory(name: str) -> Iterator[None]:
    """Raise PlugInError if the block changes the working directory, and go back to it.

    Files that are named relative to it would be written elsewhere from then on.
    """
    before = working_directory()
    yield
    after = working_directory()
    if before is not None and after != before:
        os.chdir(before)
        raise PlugInError(
            f"{name}: changed the working directory", got=after, allowed="none; open files by path"
        )
