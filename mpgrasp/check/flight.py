"""A reach without physics: a camera that flies as it is told over a table with peaks of quality on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.controllers.controller import Command, Controller, Observation, remember_failures
from mpgrasp.depth import CROP, NETWORK_SIZE
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.grasp import Grasp, GraspMap, world_to_image_angle
from mpgrasp.guards.asking import ask_controller, ask_diagnostics, ask_final_grasp
from mpgrasp.linear_algebra import product
from mpgrasp.workspace import WORKSPACE_CENTRE

INTRINSICS = D435_INTRINSICS.centre_crop(CROP).resize(NETWORK_SIZE, NETWORK_SIZE)
T_TCP_CAMERA = np.array([[0, -1, 0, 0.07], [1, 0, 0, 0], [0, 0, 1, -0.063], [0, 0, 0, 1.0]])
"""Camera on the wrist: 7 cm in front of the hand, 6.3 cm above the tool point."""
_CONFIG = EpisodeConfig()


@dataclass(frozen=True, kw_only=True)
class Peak:
    """A grasp on the bare table, the quality of which falls off as a Gaussian."""

    x: float
    y: float
    angle: float = 0.5
    """Closing direction in the world [rad]."""
    width: float = 0.04
    """Opening [m]."""
    quality: float = 0.9
    radius: float = 0.012
    """Distance at which the quality has fallen to 61 % [m]."""

    def mirrored(self) -> Peak:
        """Return it on the other side of the plane y = 0."""
        return replace(self, y=-self.y, angle=-self.angle)


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Record of a reach."""

    commands: Sequence[Command]
    positions: FloatArray
    """(n, 3) of the tool point, one a command [m]."""
    grasp: Grasp | None
    done: bool
    """The controller said so, before the time was over."""


def view_of(peaks: Sequence[Peak], T_world_camera: FloatArray, *, blind: bool = False) -> GraspMap:
    """Return a perfect detector's map of peaks on a table; without any return where `blind`."""
    shape = (INTRINSICS.height, INTRINSICS.width)
    depth = np.full(shape, np.nan if blind else T_world_camera[2, 3], np.float32)
    view = GraspMap(
        quality=np.zeros(shape, np.float32),
        angle=np.zeros(shape, np.float32),
        width=np.zeros(shape, np.float32),
        depth=depth,
        intrinsics=INTRINSICS,
        T_world_camera=T_world_camera,
        measured=~np.isnan(depth),
    )
    # the table lies at one depth, so its points need no deprojection of every pixel
    u = (np.arange(INTRINSICS.width) - INTRINSICS.cx) / INTRINSICS.fx * T_world_camera[2, 3]
    v = (np.arange(INTRINSICS.height) - INTRINSICS.cy)[:, None] / INTRINSICS.fy * T_world_camera[2, 3]
    (a, b, _, x), (c, d, _, y), *_ = T_world_camera
    for peak in peaks:
        far = (x + a * u + b * v - peak.x) ** 2 + (y + c * u + d * v - peak.y) ** 2
        quality = peak.quality * np.exp(-far / 2 / peak.radius**2)
        here = quality > view.quality
        view.quality[here] = quality[here]
        view.angle[here] = world_to_image_angle(peak.angle, T_world_camera)
        view.width[here] = peak.width * INTRINSICS.fx / depth[here]
    return view


def observations(
    controller: Controller, peaks: Sequence[Peak], *, blind: bool = False
) -> Iterator[tuple[Observation, Command]]:
    """Yield ticks until the controller is done or the time of a reach is over; it moves as it is told."""
    # the camera, not the tool, begins above the middle
    position, yaw = np.array([WORKSPACE_CENTRE[0] - T_TCP_CAMERA[0, 3], 0.0, _CONFIG.start_height]), 0.0
    for tick in range(round(_CONFIG.max_reach_time / _CONFIG.control_dt)):
        T_world_tcp = looking_down(position, yaw)
        view = view_of(peaks, product(T_world_tcp, T_TCP_CAMERA), blind=blind)
        seen = Observation(time=tick * _CONFIG.control_dt, T_world_tcp=T_world_tcp, grasp_map=view)
        command = ask_controller(controller, seen)
        ask_diagnostics(controller)
        yield seen, command
        if command.done:
            return
        position = position + command.twist[:3] * _CONFIG.control_dt
        yaw += float(command.twist[5]) * _CONFIG.control_dt


def fly(
    controller: Controller,
    *peaks: Peak,
    seed: int = 0,
    blind: bool = False,
    failures: Sequence[FloatArray] = (),
) -> Flight:
    """Reset a controller and return its reach over peaks.

    Args:
        controller: is asked through the guards of every run.
        peaks: on the table; none for an empty one.
        seed: for `reset`.
        blind: the camera has no return at all.
        failures: positions (3,) [m] to be remembered.
    """
    controller.reset(seed)
    remember_failures(controller, failures)
    ticks = list(observations(controller, peaks, blind=blind))
    return Flight(
        commands=[command for _, command in ticks],
        positions=np.array([seen.T_world_tcp[:3, 3] for seen, _ in ticks]),
        grasp=ask_final_grasp(controller),
        done=bool(ticks[-1][1].done),
    )
