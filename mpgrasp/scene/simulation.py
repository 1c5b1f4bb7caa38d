"""The running world: time, motion targets, contacts and state of one scene.

Between two calls everything in `data` belongs to the same instant: `step` ends with a forward pass,
because MuJoCo's own step leaves poses and contacts one time step behind the joint positions.
"""

from __future__ import annotations

import hashlib
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.robot import hand, panda
from mpgrasp.robot.contacts import Contacts
from mpgrasp.robot.gripper import GripperDrive

if TYPE_CHECKING:
    from mpgrasp.scene.scene import Scene

SERVO_PERIOD = 0.01
"""Time in which the arm's reference runs up to a commanded position, the period of the velocity loop [s]."""
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshot:
    """Everything that decides the future of a simulation."""

    data: mujoco.MjData
    """A copy; MuJoCo's integration state alone leaves out who sleeps, and what a sleeper's pose was."""
    q_target: FloatArray
    """(7,) [rad]"""
    dq_target: FloatArray
    """(7,) [rad/s]"""
    ramp_steps: int
    """Steps until the reference arrives at `q_target`."""
    grip_force: float | None
    """Force of each pad while grasping [N]; None while the gripper holds a width."""
    width_target: float
    """Commanded opening [m]."""
    contact_torque: FloatArray
    """(7,) that contacts caused at the joints, mean over the last `step` [N m]."""


class Simulation:
    """One scene in motion.

    Objects at rest sleep until something that moves touches them. MuJoCo does not notice when a sleeper's
    pose is written to `data`: give it a velocity, or `reset`.

    Args:
        scene: a built scene with the robot attached under the prefix `panda/`.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.model: mujoco.MjModel = scene.model
        self.data = mujoco.MjData(self.model)
        self._index_robot()
        self._contacts = Contacts(self.model, self.data, scene.objects)
        self.reset()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.data.time)

    def reset(self) -> None:
        """Back to the settled scene, arm at home and at rest, gripper open."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, self.scene.state, _STATE)
        panda.set_home(self.model, self.data)
        self._gripper.open(hand.GRIPPER_MAX_WIDTH)
        self._contact_torque: FloatArray = np.zeros(7)
        self.set_q(panda.Q_HOME)

    def step(self, n: int = 1) -> None:
        """Advance by n time steps."""
        torque = np.zeros(7)
        for _ in range(n):
            self._drive_arm()
            self._gripper.update()
            mujoco.mj_step(self.model, self.data)
            torque += self._arm_constraint
        self._contact_torque = torque / max(n, 1)
        mujoco.mj_forward(self.model, self.data)

    @property
    def q(self) -> FloatArray:
        """Joint positions (7,) [rad]."""
        return self.data.qpos[self._qpos].copy()

    @property
    def dq(self) -> FloatArray:
        """Joint velocities (7,) [rad/s]."""
        return self.data.qvel[self._dofs].copy()

    @property
    def torque(self) -> FloatArray:
        """Torques (7,) [N m] that the drives exert, gravity compensation included."""
        return self.data.qfrc_actuator[self._dofs].copy()

    @property
    def T_world_tcp(self) -> FloatArray:
        """Pose (4, 4) of the tool point."""
        return transform(self.data.site_xmat[self._tcp].reshape(3, 3), self.data.site_xpos[self._tcp])

    @property
    def twist_tcp(self) -> FloatArray:
        """Velocity (6,) of the tool point, linear then angular, world axes [m/s, rad/s]."""
        angular_linear = np.empty(6)
        mujoco.mj_objectVelocity(
            self.model, self.data, mujoco.mjtObj.mjOBJ_SITE, self._tcp, angular_linear, 0
        )
        return np.concatenate([angular_linear[3:], angular_linear[:3]])

    def set_q(self, q: FloatArray) -> None:
        """Teleport the arm to q (7,) [rad] at rest and hold it there; for the start of an episode only."""
        self.data.qpos[self._qpos] = q
        self.data.qvel[self._dofs] = 0.0
        self._q_target: FloatArray = np.array(q, float)
        self._dq_target: FloatArray = np.zeros(7)
        self._ramp_steps = 0
        mujoco.mj_forward(self.model, self.data)

    def set_arm_target(self, q: FloatArray, dq: FloatArray) -> None:
        """Be at q (7,) [rad] one `SERVO_PERIOD` from now, moving with dq (7,) [rad/s].

        The servo's reference runs up to q at the rate dq and waits there, so calls once per period with
        `q += dq * SERVO_PERIOD` give a seamless motion, and a caller that falls silent stops the arm.
        Positions are cut at the joint limits.
        """
        self._q_target = np.clip(q, panda.Q_MIN, panda.Q_MAX)
        self._dq_target = np.array(dq, float)
        self._ramp_steps = round(SERVO_PERIOD / self._dt)

    def _drive_arm(self) -> None:
        if self._ramp_steps == 0:
            self._arm_ctrl[:] = self._q_target
            return
        self._ramp_steps -= 1
        # The servo damps against standstill; its lead, kv / kp, makes it damp against dq instead.
        self._arm_ctrl[:] = self._q_target + self._dq_target * (
            self._servo_lead - self._ramp_steps * self._dt
        )

    @property
    def gripper_width(self) -> float:
        """Opening between the pads [m]."""
        return self._gripper.width

    def open_gripper(self, width: float = hand.GRIPPER_MAX_WIDTH) -> None:
        """Move to an opening [m], wider or narrower, at `hand.GRIPPER_SPEED`; cut at the hand's limits."""
        self._gripper.open(width)

    def close_gripper(self, force: float = hand.GRIPPER_FORCE_DEFAULT) -> None:
        """Close at `hand.GRIPPER_CLOSE_SPEED` until both pads press with `force` [N], whatever the width.

        Raises:
            ConfigError: a force that the hand cannot hold continuously.
        """
        self._gripper.close(force)

    def pad_contacts(self) -> tuple[set[str], set[str]]:
        """Names of the objects that press against the face of the left and of the right pad."""
        return self._contacts.pads()

    def contact_force(self) -> float:
        """Largest normal force [N] of one part of the robot against one thing that is not the robot."""
        return self._contacts.robot_force()

    def finger_contact_force(self) -> float:
        """The same for the hand, the camera and the fingers only [N]."""
        return self._contacts.hand_force()

    @property
    def external_force(self) -> FloatArray:
        """Net contact force (3,) on the tool [N], world axes, as a mean over the last `step`.

        Found as a real arm finds it, from the torques that contacts cause at the joints: the forces of both
        pads on a held object cancel. One instant says little, because a hard contact hits for a millisecond
        with hundreds of newtons.
        """
        if not self._contact_torque.any():
            return np.zeros(3)
        J = np.empty((6, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, J[:3], J[3:], self._tcp)
        wrench, *_ = np.linalg.lstsq(J[:, self._dofs].T, self._contact_torque, rcond=1e-3)
        return wrench[:3]

    def object_pose(self, name: str) -> FloatArray:
        """Pose (4, 4) of an object's body frame in the world.

        Raises:
            ConfigError: the scene has no such object.
        """
        if name not in self.scene.objects:
            raise ConfigError("unknown object", got=name, allowed=self.scene.objects)
        body = self.data.body(name)
        return transform(body.xmat.reshape(3, 3), body.xpos)

    def state_hash(self) -> str:
        """SHA-256 (hex) of the integration state."""
        return hashlib.sha256(self._state().tobytes()).hexdigest()

    def save(self) -> Snapshot:
        """Everything needed to come back to this instant."""
        return Snapshot(
            data=copy(self.data),
            q_target=self._q_target.copy(),
            dq_target=self._dq_target.copy(),
            ramp_steps=self._ramp_steps,
            grip_force=self._gripper.force,
            width_target=self._gripper.target,
            contact_torque=self._contact_torque.copy(),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Come back to a saved instant; what follows is the same to the last bit."""
        mujoco.mj_copyData(self.data, self.model, snapshot.data)
        self._q_target = snapshot.q_target.copy()
        self._dq_target = snapshot.dq_target.copy()
        self._ramp_steps = snapshot.ramp_steps
        self._gripper.force = snapshot.grip_force
        self._gripper.target = snapshot.width_target
        self._contact_torque = snapshot.contact_torque.copy()

    def _state(self) -> NDArray[np.float64]:
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def _index_robot(self) -> None:
        model, prefix = self.model, panda.PREFIX
        try:
            first = model.joint(prefix + panda.ARM_JOINTS[0])
            arm = model.actuator(prefix + panda.ARM_JOINTS[0]).id
            self._tcp = model.site(prefix + "tcp").id
        except KeyError as error:
            raise ConfigError(
                "the scene has no robot", got=str(error), allowed="build_scene(..., robot=True)"
            ) from error
        # Joints and actuators of one robot follow one another; slices give views, quick to write to.
        self._qpos = slice(first.qposadr[0], first.qposadr[0] + 7)
        self._dofs = slice(first.dofadr[0], first.dofadr[0] + 7)
        self._arm_ctrl = self.data.ctrl[arm : arm + 7]
        self._gripper = GripperDrive(model, self.data)
        self._arm_constraint = self.data.qfrc_constraint[self._dofs]
        self._dt = float(model.opt.timestep)
        gain, bias = model.actuator_gainprm[arm : arm + 7], model.actuator_biasprm[arm : arm + 7]
        self._servo_lead = -bias[:, 2] / gain[:, 0]  # kv / kp [s]
