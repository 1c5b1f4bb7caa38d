"""Stages of an episode: the functions in which its time is spent, watched while somebody wants to know.

Nothing is measured, and nothing costs time, unless the block of `watched` lasts.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

from mpgrasp.bench.profiling.stopwatch import Stopwatch
from mpgrasp.extras import is_installed

NETWORK, IMAGE, RENDER, REST = "network", "its image, its maps", "render", "the rest"
BEFORE, REACH, EXECUTION, AFTER = "before", "reach", "execution", "after"
PARTS = (BEFORE, REACH, EXECUTION, AFTER)
"""Parts of an episode: up to the first tick, up to the choice of a grasp, up to its verdict, what remains."""

_OF_TORCH = "mpgrasp.detectors.runtimes.torch_runtime"
STAGES: Mapping[str, tuple[str, ...]] = {
    NETWORK: (
        f"{_OF_TORCH}:TorchRuntime.__call__",
        "mpgrasp.detectors.runtimes.openvino:OpenVinoRuntime.__call__",
        "mpgrasp.detectors.runtimes.shared:SharedRuntime.__call__",
    ),
    IMAGE: ("mpgrasp.episode.episode:ask_detector",),
    RENDER: ("mpgrasp.camera.wrist_camera:WristCamera.capture",),
    "OpenGL set-up": ("mpgrasp.camera.rasteriser:Rasteriser.__init__",),
    "noise": ("mpgrasp.camera.noise:apply",),
    "grid map": ("mpgrasp.controllers.grid_map:GridMap.update",),
    "utility": ("mpgrasp.episode.episode:ask_controller",),
    "inverse kinematics": (
        "mpgrasp.motion.ik:DifferentialIK.step",
        "mpgrasp.motion.arm_driver:scaled_profile",
    ),
    "physics": ("mpgrasp.scene.simulation:Simulation.step",),
    "forces and reflexes": ("mpgrasp.motion.arm_driver:ArmDriver._tick",),
    "scene": ("mpgrasp.episode.episode:World",),
    "trace": (
        "mpgrasp.bench.playing.trace_recorder:TraceRecorder.tick",
        "mpgrasp.bench.playing.trace_recorder:TraceRecorder.save",
    ),
}
"""Functions by stage, as module:name; what a detector without a network does is counted as its maps."""

_BEGINS = {
    "mpgrasp.episode.episode:Episode.__init__": BEFORE,
    "mpgrasp.episode.episode:reach": REACH,
    "mpgrasp.episode.clearing:reach": REACH,
    "mpgrasp.episode.episode:execute_grasp": EXECUTION,
}


@contextmanager
def watched(watch: Stopwatch) -> Iterator[None]:
    """Have the stopwatch count the stages of every episode that is played in the block."""
    with ExitStack() as stack:
        for stage, functions in STAGES.items():
            for path in functions:
                if path.startswith(_OF_TORCH) and not is_installed("torch"):
                    continue
                stack.enter_context(_replaced(path, functools.partial(_timed, watch, stage)))
        for path, part in _BEGINS.items():
            stack.enter_context(_replaced(path, functools.partial(_parted, watch, part)))
        stack.enter_context(watch.during(AFTER))
        yield


def _timed(watch: Stopwatch, stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function, updated=())
    def timed(*args: Any, **kwargs: Any) -> Any:
        with watch.stage(stage):
            return function(*args, **kwargs)

    return timed


def _parted(watch: Stopwatch, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function, updated=())
    def parted(*args: Any, **kwargs: Any) -> Any:
        with watch.during(part), watch.stage(REST):
            return function(*args, **kwargs)

    return parted


@contextmanager
def _replaced(path: str, wrap: Callable[[Callable[..., Any]], Callable[..., Any]]) -> Iterator[None]:
    """Have a function of a module or of a class replaced while the block lasts."""
    module, _, name = path.partition(":")
    *owners, attribute = name.split(".")
    owner: Any = functools.reduce(getattr, owners, importlib.import_module(module))
    function = getattr(owner, attribute)
    setattr(owner, attribute, wrap(function))
    try:
        yield
    finally:
        setattr(owner, attribute, function)
