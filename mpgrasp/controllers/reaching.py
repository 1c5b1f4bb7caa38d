"""Reaching of MP-PC and its baseline MVP: fuse a view, find the best viewpoint near by, go there and down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpgrasp.controllers.config import ReachConfig
from mpgrasp.controllers.controller import Command, Observation
from mpgrasp.controllers.grid_map import GridMap
from mpgrasp.controllers.information import exploration_cost, grid_entropy, information_gain, utility
from mpgrasp.geometry import FloatArray, wrap_half_pi, wrap_pi
from mpgrasp.grasp import Grasp, GraspMap, best_pixel, peak_height
from mpgrasp.linear_algebra import dot, norm
from mpgrasp.robot.limits import Q_HOME, Q_MAX, Q_MIN

_TIE = 1e-3
"""Utilities closer to the best than this fraction of the range in the window are equally good."""
_TIE_NAT = 1e-6
"""And so are utilities closer than this: single precision makes no better difference [nat]."""
_YAW_SLACK = np.deg2rad(15)
"""Angle beyond the yaw range at which a grasp makes the hand turn the other way to meet it [rad]."""

_WRIST_SPARE = 0.15
"""Angle to the limits of joint 7 left to IK's margin and to the elbow, which turns the hand too [rad]."""


class ReachingController:
    """Multi-view reaching: fuse a view, go towards the best viewpoint near by and down, grasp in the end.

    Algorithm 1 with `choice` "pool" and an `alpha` below 1, multi-view picking with "grid" and 1.

    Args:
        config: settings; those of the class unless given.
    """

    name: str
    defaults: ReachConfig

    def __init__(self, config: ReachConfig | None = None) -> None:
        self.config = config or self.defaults
        self.reset(0)

    def reset(self, seed: int) -> None:
        self.grid = GridMap(self.config.grid)
        # where nothing tells directions apart the arm explores in a random one, and sticks to it
        heading = np.random.default_rng(seed).uniform(-np.pi, np.pi)
        self._heading = np.array([np.cos(heading), np.sin(heading)])
        self.pool: list[Grasp] = []
        """B of Algorithm 1: the best grasp of every view."""
        self._diagnostics: dict[str, FloatArray | float | bool] = {}
        self._entropy: FloatArray | None = None

    def remember_failure(self, position: FloatArray) -> None:
        """Lower quality around a failed grasp at world (3,) [m]; to be told anew after each `reset`."""
        self.grid.suppress(position)

    def update(self, observation: Observation) -> Command:
        config, grasp_map, tcp = self.config, observation.grasp_map, observation.T_world_tcp
        cells = self.grid.update(grasp_map)
        if config.choice == "pool" and (best := best_grasp_in_view(grasp_map, cells, self.grid)) is not None:
            self.pool.append(best)

        viewpoint = grasp_map.T_world_camera[:3, 3]
        map_of_utility = self._evaluate(grasp_map, float(tcp[2, 3]))
        target = self._best_viewpoint(map_of_utility, viewpoint[:2])
        pull = (target - viewpoint[:2]) / config.window
        velocity = config.v_1 * pull / max(1.0, norm(pull))
        height = peak_height(grasp_map.quality)
        exists = height > config.peak_threshold
        velocity = velocity * (1.0 if exists else config.alpha)

        grasp = self._enough(self.grid.best_grasp())
        yaw_rate = 0.0 if grasp is None else self._yaw_rate(grasp.angle, tcp)
        done = bool(tcp[2, 3] <= config.z_min)
        descent = self._descent_speed(velocity)
        twist = np.zeros(6) if done else np.array([*velocity, -descent, 0.0, 0.0, yaw_rate])
        self._diagnostics |= {
            "peak": exists,
            "peak_height": height,
            "viewpoint_x": float(target[0]),
            "viewpoint_y": float(target[1]),
            "best_quality": 0.0 if grasp is None else grasp.quality,
        }
        return Command(twist=twist, gripper=config.gripper_open, done=done)

    def final_grasp(self) -> Grasp | None:
        """Return the grasp of the grid's best cell (eq. 6), or the best of the pool (Algorithm 1, line 17).

        Of equal grasps in the pool the latest counts, which was seen from nearest by.
        """
        if self.config.choice == "grid":
            return self._enough(self.grid.best_grasp())
        return self._enough(max(reversed(self.pool), key=lambda grasp: grasp.quality, default=None))

    def _enough(self, grasp: Grasp | None) -> Grasp | None:
        return grasp if grasp is not None and grasp.quality >= self.config.min_quality else None

    def _descent_speed(self, horizontal: FloatArray) -> float:
        """Speed downwards [m/s] beside a horizontal velocity (2,) [m/s]."""
        c = self.config
        if c.descent == "constant":
            return c.v_z
        return float(np.sqrt(max(c.v_1**2 - dot(horizontal, horizontal), 0.0)))

    def diagnostics(self) -> dict[str, FloatArray | float | bool]:
        return dict(self._diagnostics)

    def _evaluate(self, grasp_map: GraspMap, height: float) -> FloatArray:
        """Utility (ny, nx) of every viewpoint at the present height, eq. 12."""
        c, k = self.config, grasp_map.intrinsics
        # a sixth of the field of view where it meets the table, in cells; mean of both image sides
        footprint = (k.width / k.fx + k.height / k.fy) / 2 * float(grasp_map.T_world_camera[2, 3])
        entropy = self._entropy = grid_entropy(self.grid, self._entropy)
        gain = information_gain(entropy, max(footprint, 0.0) / 6 / c.grid.cell, c.border)
        best = self.grid.best_cell()
        centre = None if best is None else self.grid.position(best)
        low, high, t_z = c.z_min, c.z_max, height
        if c.cost_heights is not None:
            (low, high), t_z = c.cost_heights, float(grasp_map.T_world_camera[2, 3])
        cost = exploration_cost(self.grid, centre, (t_z - low) / (high - low))
        result = utility(gain, cost, c.gamma)
        self._diagnostics = {
            "entropy": entropy,
            "information_gain": gain,
            "utility": result,
            "mean_quality": self.grid.mean_quality(),
        }
        return result

    def _best_viewpoint(self, values: FloatArray, camera: FloatArray) -> FloatArray:
        """World (x, y) of the best utility within the window around the camera's (x, y).

        Where several are equally good, the one farthest along the episode's random heading, so that the
        choice is a direction and not the order of the array. Off the grid, its nearest cell.
        """
        x, y = self.grid.axes()
        dx, dy = x - camera[0], (y - camera[1])[:, None]
        squared = dx * dx + dy * dy  # (ny, nx)
        near = squared <= max(self.config.window**2, float(squared.min()))
        best, worst = values[near].max(), values[near].min()
        tied = near & (values >= best - max(_TIE_NAT, _TIE * (best - worst)))
        along = np.where(tied, dx * self._heading[0] + dy * self._heading[1], -np.inf)
        row, col = np.unravel_index(np.argmax(along), along.shape)
        return self.grid.position((int(row), int(col)))

    def _yaw_rate(self, angle: float, T_world_tcp: FloatArray) -> float:
        """Yaw rate [rad/s] towards closing direction `angle`, by the smaller turn that stays in range."""
        c = self.config
        closing = np.arctan2(T_world_tcp[1, 1], T_world_tcp[0, 1])
        yaw = float(wrap_pi(np.arctan2(T_world_tcp[1, 0], T_world_tcp[0, 0]) - c.home_yaw))
        goal = yaw + float(wrap_half_pi(angle - closing))
        low, high = self._yaw_bounds(T_world_tcp)
        if not low - _YAW_SLACK <= goal <= high + _YAW_SLACK:
            goal -= np.copysign(np.pi, goal)
        # within the slack the hand waits at the end of its range; the grasp itself turns the rest
        goal = float(np.clip(goal, low, high))
        return float(np.clip(c.yaw_gain * (goal - yaw), -c.yaw_rate_max, c.yaw_rate_max))

    def _yaw_bounds(self, T_world_tcp: FloatArray) -> tuple[float, float]:
        """Return the lowest and highest heading from home [rad]: the yaw range, moved on to spare joint 7.

        The arm points to the tool, and joint 7 turns the hand back by as much: the farther aside, the less
        is left for the hand's own turn.
        """
        range_ = self.config.yaw_range
        bearing = float(np.arctan2(T_world_tcp[1, 3], T_world_tcp[0, 3]))
        low = bearing - float(Q_MAX[6] - Q_HOME[6]) + _WRIST_SPARE
        high = bearing - float(Q_MIN[6] - Q_HOME[6]) - _WRIST_SPARE
        move = max(low + range_, 0.0) + min(high - range_, 0.0)
        return -range_ + move, range_ + move


def best_grasp_in_view(grasp_map: GraspMap, cells: NDArray[np.intp], grid: GridMap) -> Grasp | None:
    """Lines 11-14: the grasp of the best pixel whose point lies in the workspace; None where none does.

    `cells` (H, W) is what `GridMap.update` returned for this view. Quality is lowered around remembered
    failures.
    """
    if (cells < 0).all():
        return None
    quality = grasp_map.quality
    if grid.failures.any():
        quality = quality - grid.failures.ravel()[cells]
    row, col = best_pixel(np.where(cells >= 0, quality, -np.inf))
    return replace(grasp_map.grasp_at(row, col), quality=float(np.clip(quality[row, col], 0.0, 1.0)))
