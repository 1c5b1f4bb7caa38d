"""The Panda's hand without its arm: flies through a scene, as stiff and as heavy as the arm makes it.

Three slides and a hinge carry the hand with its camera and fingers. Four degrees of freedom instead of
seven, and no inverse kinematics: grasps can be tried by the thousand. The tool always points down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, looking_down
from mpgrasp.linear_algebra import norm
from mpgrasp.robot import hand, panda
from mpgrasp.scene.moving_scene import MovingScene
from mpgrasp.scene.objects.model import OBJECT_GROUP
from mpgrasp.scene.scene import STATE, Scene
from mpgrasp.scene.solver import set_in_motion

JOINTS = ("x", "y", "z", "yaw")
"""World position of the tool point [m] and heading of the hand's x axis about world z [rad]."""
STIFFNESS = (5600.0, 5000.0, 8500.0, 650.0)
"""Stiffness of the tool point along each axis, all others being free [N/m, N m/rad]: 1 / diag(J Kq^-1 J^T)
for the arm's servo stiffness Kq, tool down over the middle of the workspace."""
DAMPING = (240.0, 235.0, 420.0, 18.0)
"""The same for the servo's damping [N s/m, N m s/rad]."""
INERTIA = (3.4, 4.8, 8.5, 0.12)
"""The same for the arm's joint-space inertia [kg, kg m2], hand included."""

STILL_SPEED = 1e-4
"""Speed below which an object does not creep [m/s]."""
STILL_RATE = 1e-3
"""The same for its rotation [rad/s]."""

_AXES = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, -1.0))  # in the hand's frame


def add_free_hand(spec: mujoco.MjSpec) -> None:
    """Add the hand with its camera and fingers to a world, under the prefix `panda/`, on joints `JOINTS`.

    At zero the tool point lies in the world's origin and `T_world_tcp` is `looking_down((0, 0, 0))`.
    """
    arm = panda.panda_spec()
    root = spec.worldbody.add_frame().attach_body(arm.body("hand"), panda.PREFIX, "")
    for mesh in list(spec.meshes):
        if mesh.name.startswith(panda.PREFIX + "link"):
            spec.delete(mesh)
    root.pos = [0.0, 0.0, hand.TCP_OFFSET]
    root.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # instead of the Euler angles on the arm
    root.quat = [0.0, 1.0, 0.0, 0.0]
    own = _own_inertia(root)
    for k, (name, axis) in enumerate(zip(JOINTS, _AXES, strict=True)):
        slide = k < 3
        root.add_joint(
            name=panda.PREFIX + name,
            type=mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis,
            armature=INERTIA[k] - own if slide else INERTIA[k],
        )
        spec.add_actuator(
            name=panda.PREFIX + name,
            target=panda.PREFIX + name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            gainprm=[STIFFNESS[k], *[0.0] * 9],
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            biasprm=[0.0, -STIFFNESS[k], -DAMPING[k], *[0.0] * 7],
        )


def _own_inertia(hand: mujoco.MjsBody) -> float:
    """Mass [kg] of the hand and all that it carries."""
    return float(hand.mass + sum(_own_inertia(body) for body in hand.bodies))


class FreeHand(MovingScene):
    """One scene in motion, with a free-flying hand in it.

    Args:
        scene: built without the robot.

    Raises:
        ConfigError: the scene has a robot.
    """

    def __init__(self, scene: Scene) -> None:
        if any(body.name.startswith(panda.PREFIX) for body in scene.spec.bodies):
            raise ConfigError(
                "the scene has a robot", got=scene.objects, allowed="build_scene(..., robot=False)"
            )
        super().__init__(_with_hand(scene))
        self._index()
        self.reset()
        self.refresh()
        self.top = self._highest()
        """Height of the settled objects' highest point [m], or a little above it."""

    def reset(self) -> None:
        """Back to the settled scene, gripper open, hand at rest high above it."""
        mujoco.mj_resetData(self.model, self.data)
        self._stale = True
        self._force: FloatArray = np.zeros(3)
        self.place([0.0, 0.0, 1.0], 0.0, hand.GRIPPER_MAX_WIDTH)

    def place(self, position: ArrayLike, yaw: float, width: float) -> None:
        """Teleport the hand: tool point (3,) [m], heading [rad] and opening [m], at rest; it stays there."""
        self._target = np.array([*np.asarray(position, float), yaw])
        self._qpos[:] = self._ctrl[:] = self._target
        self._qvel[:] = 0.0
        self._gripper.set_width(width)
        self._stale = True

    def touches(self) -> bool:
        """True if a part of the hand touches anything, where it is now."""
        self._stale = True
        with self._watch:
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_collision(self.model, self.data)
        mine = self._is_hand[self.data.contact.geom]  # (ncon, 2)
        return bool((mine[:, 0] != mine[:, 1]).any())

    def step(self, target: FloatArray, n: int) -> None:
        """Advance by n time steps, at the end of which the tool point should be at target (3,) [m].

        Raises:
            SimulationError: MuJoCo has warned, now or since the last `reset`.
        """
        way = target - self._target[:3]
        # the servo damps against standstill; its lead, damping / stiffness, makes it damp against the motion
        share = (np.arange(1 - n, 1) + _LEAD[:, None] / self._dt) / n  # (3, n)
        references = target + (way[:, None] * share).T
        force = np.zeros(3)
        with self._watch:
            for k in range(n):
                self._ctrl[:3] = references[k]
                self._gripper.update()
                mujoco.mj_step(self.model, self.data)
                force += self._constraint
        self._target[:3] = target
        self._force = force / n
        self._stale = True

    def are_still(self, names: Sequence[str]) -> bool:
        """True if none of these objects moves faster than `STILL_SPEED` and `STILL_RATE`."""
        rows = [self.scene.objects.index(name) for name in names]
        v = np.abs(self.data.qvel[self._free_dofs[rows]])  # (n, 6)
        return bool((v[:, :3] < STILL_SPEED).all() and (v[:, 3:] < STILL_RATE).all())

    @property
    def external_force(self) -> FloatArray:
        """Net contact force (3,) on the hand [N], world axes, as a mean over the last `step`."""
        return self._force

    @property
    def T_world_tcp(self) -> FloatArray:
        """Pose (4, 4) of the tool point."""
        x, y, z, yaw = self._qpos
        return looking_down([x, y, z], float(yaw))

    @property
    def T_desired(self) -> FloatArray:
        """Pose (4, 4) at which the tool point should be."""
        return looking_down(self._target[:3], float(self._target[3]))

    @property
    def lag(self) -> float:
        """Distance from where the tool point should be to where it is [m]."""
        return norm(self._qpos[:3] - self._target[:3])

    def _highest(self) -> float:
        model, data = self.model, self.data
        mine = np.flatnonzero(model.geom_group == OBJECT_GROUP)
        up = data.geom_xmat[mine].reshape(-1, 3, 3)[:, 2]  # (n, 3), world z in each geom's frame
        centre = data.geom_xpos[mine, 2] + (up * model.geom_aabb[mine, :3]).sum(axis=1)
        return float((centre + (np.abs(up) * model.geom_aabb[mine, 3:]).sum(axis=1)).max(initial=0.0))

    def _index(self) -> None:
        model, data, prefix = self.model, self.data, panda.PREFIX
        first = model.joint(prefix + JOINTS[0])
        q, v = first.qposadr[0], first.dofadr[0]
        self._qpos, self._qvel = data.qpos[q : q + 4], data.qvel[v : v + 4]
        self._constraint = data.qfrc_constraint[v : v + 3]
        drive = model.actuator(prefix + JOINTS[0]).id
        self._ctrl = data.ctrl[drive : drive + 4]
        self._dt = float(model.opt.timestep)
        free = [model.joint(f"{name}/free").dofadr[0] for name in self.scene.objects]
        self._free_dofs = np.array(free, int)[:, None] + np.arange(6)
        self._is_hand = model.geom_group == panda.ROBOT_GROUP


_LEAD = np.array(DAMPING[:3]) / np.array(STIFFNESS[:3])  # [s]


def _with_hand(scene: Scene) -> Scene:
    """The same scene with the hand in it."""
    spec = scene.spec.copy()
    for name in scene.objects:
        # what nothing touches stays as it lies and costs nothing
        spec.body(name).sleep = mujoco.mjtSleepPolicy.mjSLEEP_INIT
    add_free_hand(spec)
    set_in_motion(spec)
    model = spec.compile()
    before = scene.data()
    for name in scene.objects:
        joint = f"{name}/free"
        # sleepers are where the model has them
        start = model.joint(joint).qposadr[0]
        model.qpos0[start : start + 7] = before.joint(joint).qpos
    data = mujoco.MjData(model)
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    state.setflags(write=False)
    return replace(scene, model=model, spec=spec, state=state)
