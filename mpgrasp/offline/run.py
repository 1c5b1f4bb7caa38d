"""Plays a recording to a detector and a controller, and notes what they would have done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mpgrasp.controllers.controller import Command, Controller, Observation
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.grasp import Grasp, GraspMap, peak_height
from mpgrasp.guards.asking import ask_controller, ask_detector, ask_final_grasp
from mpgrasp.offline.recorded import RecordedView


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """What became of one view."""

    view: RecordedView
    grasp_map: GraspMap
    """Of the detector."""
    command: Command
    """Of the controller: what the arm would do until the next view."""
    grasp: Grasp | None
    """What it would grasp now, in the world."""

    @property
    def peak(self) -> float:
        """Height of the peak of the quality, in [0, 1]."""
        return peak_height(self.grasp_map.quality)


def play(views: Iterable[RecordedView], detector: GraspDetector, controller: Controller) -> Iterator[Step]:
    """Yield what becomes of every view, until the controller is done.

    Nothing moves, so the views stay what they were, whatever is commanded.

    Args:
        views: of a recording, or of a camera that runs.
        detector: one that needs no truth.
        controller: is reset before the first view.

    Raises:
        PlugInError: what the detector or the controller returned cannot be used.
        ConfigError: a view that cannot be used.
    """
    detector.reset(None)
    controller.reset(0)
    start: float | None = None
    for view in views:
        start = view.frame.time if start is None else start
        grasp_map = ask_detector(detector, view.frame)
        observation = Observation(
            time=view.frame.time - start, T_world_tcp=view.T_world_tcp, grasp_map=grasp_map
        )
        command = ask_controller(controller, observation)
        yield Step(view=view, grasp_map=grasp_map, command=command, grasp=ask_final_grasp(controller))
        if command.done:
            return
