"""Seeded placing: positions at which objects are dropped, and stepping until they lie still.

Nothing here knows of robots, cameras or detectors: a scene is never drawn again because of what
somebody could or could not see in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, rotation_from_quaternion
from mpgrasp.linear_algebra import norm, product
from mpgrasp.scene.cloth import Cloth
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import ObjectModel
from mpgrasp.scene.watch import Watch

REGION_TOLERANCE = 0.03
"""An object may roll this far out of the region's edge before it is dropped again [m]."""
STACK_SHIFT = 0.02
"""An object of a stack that settles further from where it was set down has fallen [m]."""
STACK_TILT = 0.15
"""The same for its vertical axis [rad]."""
STILL_SPEED = 0.002
"""Fastest linear motion of an object that counts as at rest [m/s]."""
STILL_RATE = 0.03
"""Fastest rotation of an object that counts as at rest [rad/s]."""

_DROP_GAP = 0.002  # [m] between an object and what lies below it
_CHECK_STEPS = 15  # steps between two looks at the velocities
_CALM_CHECKS = 4  # looks in a row that must find all at rest
_ROUND_TIME = 2.0  # [s] of simulation before what still moves is dropped again
_DROP_TIME = 0.4  # [s] of simulation between two drops of a pile
_ROUNDS = 12
_LOWERING = 0.001  # [m] by which an object of a stack comes down at a time
_STACK_TRIES = 10  # jitters tried for a stack that stands
_TRIES = 60  # random positions tried for a free spot
_PARKED = 20.0  # [m] height at which objects wait for their drop


@dataclass
class Settler:
    """Drops objects into a robot-free model and steps it until they rest, as the scene's settings say."""

    model: mujoco.MjModel
    names: Sequence[str]
    objects: Sequence[ObjectModel]
    cloth: Cloth
    config: SceneConfig
    rng: np.random.Generator
    data: mujoco.MjData = field(init=False)

    def __post_init__(self) -> None:
        self.data = mujoco.MjData(self.model)
        self._watch = Watch(self.model, self.data)
        self._centre = np.array(self.config.centre, float)
        if self.config.centre_spread > 0:
            self._centre += self.rng.uniform(-1, 1, 2) * self.config.centre_spread
        joints = [self.model.joint(f"{name}/free") for name in self.names]
        self._qpos = np.array([j.qposadr[0] for j in joints], int)
        self._dof = np.array([j.dofadr[0] for j in joints], int)
        self._bodies = np.array([self.model.body(name).id for name in self.names], int)
        self._radius = np.zeros(len(joints))  # of the footprint, [m]
        self._dropped = np.zeros(len(joints), bool)

    def scatter(self) -> FloatArray:
        """Put all objects down next to each other; poses (n, 7) at rest, position [m] and wxyz."""
        for k in range(len(self.objects)):
            self._drop(k, self._free_spot(k))
        return self._settle(pile=False)

    def pile(self) -> FloatArray:
        """Drop the objects one after the other near the centre; poses (n, 7) at rest."""
        for k in range(len(self.objects)):
            self._drop(k, self._pile_spot())
            self._step(_DROP_TIME)
        return self._settle(pile=True)

    def stack(self) -> FloatArray:
        """Set the objects down one after the other, each on what lies below it; poses (n, 7) at rest."""
        for _ in range(_STACK_TRIES):
            fallen = self._try_stack()
            if fallen is None:
                return self._poses()
        raise ConfigError(
            "the stack does not stand",
            got=f"{fallen} left its place",
            allowed=f"a pattern in which all come to rest within {STACK_SHIFT:g} m and {STACK_TILT:g} rad",
        )

    def _try_stack(self) -> str | None:
        """Name of an object that left its place or does not come to rest, if any."""
        pattern, jitter = np.asarray(self.config.pattern, float), self.config.jitter
        mujoco.mj_resetData(self.model, self.data)
        self._dropped[:] = False
        shift = self.rng.uniform(-1, 1, (len(pattern), 3)) * [jitter[0], jitter[0], jitter[1]]
        places = pattern + shift + [*self._centre, 0.0]
        set_down = np.empty((len(places), 3))
        self._park()
        for k, (x, y, yaw) in enumerate(places):
            self._put(k, np.array([x, y]), np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]))
            self._lower(k)
            set_down[k] = self._pose(k)[:3]
            self._step(_DROP_TIME)
        calm = self._step(_ROUND_TIME)
        away = np.linalg.norm(self.data.qpos[self._qpos[:, None] + [0, 1, 2]] - set_down, axis=1)
        tilt = np.arccos(np.clip(self.data.xmat[self._bodies, 8], -1, 1))
        fall = np.maximum(away / STACK_SHIFT, tilt / STACK_TILT)
        return None if calm and fall.max() <= 1 else str(self.names[int(np.argmax(fall))])

    def _lower(self, k: int) -> None:
        """Bring object k straight down until it all but touches something."""
        height = self._qpos[k] + 2
        while not self._touches(k):
            self.data.qpos[height] -= _LOWERING
        self.data.qpos[height] += _LOWERING

    def _touches(self, k: int) -> bool:
        with self._watch:
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_collision(self.model, self.data)
        bodies = self.model.geom_bodyid[self.data.contact.geom]  # (ncon, 2)
        return bool((bodies == self._bodies[k]).any())

    def _settle(self, *, pile: bool) -> FloatArray:
        for _ in range(_ROUNDS):
            calm = self._step(_ROUND_TIME)
            away = np.abs(self.data.qpos[self._qpos[:, None] + [0, 1]] - self._centre).max(axis=1)
            stray = (away > self.config.half_extent + REGION_TOLERANCE) | ~self._still()
            if calm and not stray.any():
                return self._poses()
            again = [int(k) for k in np.flatnonzero(stray)]
            self._dropped[again] = False
            for k in again:
                self._drop(k, self._pile_spot() if pile else self._free_spot(k))
        raise ConfigError(
            "objects do not come to rest within the placing region",
            got=[self.names[k] for k in again],
            allowed="a larger region, fewer objects or a flatter cloth",
        )

    def _drop(self, k: int, spot: FloatArray) -> None:
        """Put object k just above whatever lies at the spot (2,) [m], in an orientation drawn for it."""
        self._put(k, spot, self._orientation())

    def _put(self, k: int, spot: FloatArray, quaternion: FloatArray) -> None:
        points = product(self.objects[k].points, rotation_from_quaternion(quaternion).T)
        radius = float(np.linalg.norm(points[:, :2], axis=1).max())
        ground = self.cloth.highest(float(spot[0]), float(spot[1]), radius)
        for j in map(int, np.flatnonzero(self._dropped)):
            pose = self._pose(j)
            if norm(pose[:2] - spot) < radius + self._radius[j]:
                top = product(self.objects[j].points, rotation_from_quaternion(pose[3:]).T)[:, 2].max()
                ground = max(ground, float(pose[2] + top))
        height = ground - float(points[:, 2].min()) + _DROP_GAP
        a, v = self._qpos[k], self._dof[k]
        self.data.qpos[a : a + 7] = [*spot, height, *quaternion]
        self.data.qvel[v : v + 6] = 0
        self._radius[k] = radius
        self._dropped[k] = True

    def _orientation(self) -> FloatArray:
        """wxyz; the same number of draws for either kind of pose."""
        yaw = self.rng.uniform(-np.pi, np.pi)
        turn = self.rng.standard_normal(4)
        if self.config.pose == "random":
            return turn / norm(turn)
        return np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])

    def _pile_spot(self) -> FloatArray:
        offset = np.clip(self.rng.normal(0.0, 0.3, 2), -1, 1)
        return self._centre + offset * self.config.half_extent

    def _free_spot(self, k: int) -> FloatArray:
        """Position (2,) whose footprint overlaps no other; the roomiest of those tried where all overlap."""
        points = self.objects[k].points
        radius = np.linalg.norm(points[:, :2] if self.config.pose == "upright" else points, axis=1).max()
        others = self.data.qpos[self._qpos[self._dropped][:, None] + [0, 1]]
        best, room = self._centre, -np.inf
        for _ in range(_TRIES):
            spot = self._centre + self.rng.uniform(-1, 1, 2) * self.config.half_extent
            gaps = np.linalg.norm(others - spot, axis=1) - self._radius[self._dropped] - radius
            gap = gaps.min(initial=np.inf)
            if gap > room:
                best, room = spot, gap
            if room > 0:
                break
        return best

    def _poses(self) -> FloatArray:
        """Copy (n, 7) of all poses: position [m] and wxyz."""
        return np.array(self.data.qpos[self._qpos[:, None] + np.arange(7)])

    def _pose(self, k: int) -> FloatArray:
        """View (7,) of one pose: position [m] and wxyz."""
        return np.asarray(self.data.qpos[self._qpos[k] : self._qpos[k] + 7])

    def _still(self) -> NDArray[np.bool_]:
        """(n,) True where an object is at rest."""
        v = np.abs(self.data.qvel[self._dof[:, None] + np.arange(6)])
        return np.asarray((v[:, :3].max(axis=1) < STILL_SPEED) & (v[:, 3:].max(axis=1) < STILL_RATE))

    def _step(self, time: float) -> bool:
        """Step for at most `time` [s]; True if all dropped objects came to rest before."""
        calm = 0
        for _ in range(round(time / self.model.opt.timestep / _CHECK_STEPS)):
            self._park()  # falls a few centimetres between two checks
            with self._watch:
                mujoco.mj_step(self.model, self.data, _CHECK_STEPS)
            calm = calm + 1 if self._still()[self._dropped].all() else 0
            if calm >= _CALM_CHECKS:
                return True
        return False

    def _park(self) -> None:
        """Keep what was not dropped yet out of the way."""
        for k in np.flatnonzero(~self._dropped):
            self.data.qpos[self._qpos[k] : self._qpos[k] + 7] = [2.0 * k, 0, _PARKED, 1, 0, 0, 0]
            self.data.qvel[self._dof[k] : self._dof[k] + 6] = 0
