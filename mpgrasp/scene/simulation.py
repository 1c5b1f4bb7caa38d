"""A scene with the arm in motion: time, motion targets, contacts and state.

Between two calls everything in `data` belongs to the same instant: `step` ends with a forward pass,
because MuJoCo's own step leaves poses and contacts one time step behind the joint positions.
"""

from __future__ import annotations

import hashlib

import mujoco
import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.linear_algebra import least_squares
from mpgrasp.robot import hand, panda
from mpgrasp.scene.moving_scene import MovingScene
from mpgrasp.scene.scene import STATE, Scene

SERVO_PERIOD = 0.01
"""Time in which the arm's reference runs up to a commanded position, the period of the velocity loop [s]."""


class Simulation(MovingScene):
    """One scene in motion, with the arm in it.

    Objects at rest sleep until something that moves touches them. MuJoCo does not notice when a sleeper's
    pose is written to `data`: give it a velocity, or `reset`.

    Args:
        scene: a built scene with the robot attached under the prefix `panda/`.
    """

    def __init__(self, scene: Scene) -> None:
        try:
            super().__init__(scene)
            self._index_arm()
        except KeyError as error:
            raise ConfigError(
                "the scene has no robot", got=str(error), allowed="build_scene(..., robot=True)"
            ) from error
        self.reset()

    def reset(self) -> None:
        """Back to the settled scene, arm at home and at rest, gripper open."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, self.scene.state, STATE)
        panda.set_home(self.model, self.data)
        self._gripper.open(hand.GRIPPER_MAX_WIDTH)
        self._contact_torque: FloatArray = np.zeros(7)
        self.set_q(panda.Q_HOME)

    def step(self, n: int = 1) -> None:
        """Advance by n time steps.

        Raises:
            SimulationError: MuJoCo has warned, now or since the last `reset`.
        """
        torque = np.zeros(7)
        with self._watch:
            for _ in range(n):
                self._drive_arm()
                self._gripper.update()
                mujoco.mj_step(self.model, self.data)
                torque += self._arm_constraint
            mujoco.mj_forward(self.model, self.data)
        self._contact_torque = torque / max(n, 1)

    @property
    def q(self) -> FloatArray:
        """Joint positions (7,) [rad]."""
        return np.array(self.data.qpos[self._qpos])

    @property
    def dq(self) -> FloatArray:
        """Joint velocities (7,) [rad/s]."""
        return np.array(self.data.qvel[self._dofs])

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
        with self._watch:
            mujoco.mj_forward(self.model, self.data)

    def set_arm_target(self, q: FloatArray, dq: FloatArray) -> None:
        """Be at q (7,) [rad] one `SERVO_PERIOD` from now, moving with dq (7,) [rad/s].

        The servo's reference runs up to q at the rate dq and waits there, so calls once per period with
        `q += dq * SERVO_PERIOD` give a seamless motion, and a caller that falls silent stops the arm.
        Positions are cut at the joint limits.
        """
        self._q_target = np.minimum(np.maximum(q, panda.Q_MIN), panda.Q_MAX)
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
        wrench = least_squares(J[:, self._dofs].T, self._contact_torque, 1e-3)
        return wrench[:3]

    def state_hash(self) -> str:
        """SHA-256 (hex) of the integration state."""
        state = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, state, STATE)
        return hashlib.sha256(state.tobytes()).hexdigest()

    def _index_arm(self) -> None:
        model, prefix = self.model, panda.PREFIX
        first = model.joint(prefix + panda.ARM_JOINTS[0])
        arm = model.actuator(prefix + panda.ARM_JOINTS[0]).id
        self._tcp = model.site(prefix + "tcp").id
        # Joints and actuators of one robot follow one another; slices give views, quick to write to.
        self._qpos = slice(first.qposadr[0], first.qposadr[0] + 7)
        self._dofs = slice(first.dofadr[0], first.dofadr[0] + 7)
        self._arm_ctrl = self.data.ctrl[arm : arm + 7]
        self._arm_constraint = self.data.qfrc_constraint[self._dofs]
        self._dt = float(model.opt.timestep)
        gain, bias = model.actuator_gainprm[arm : arm + 7], model.actuator_biasprm[arm : arm + 7]
        self._servo_lead = -bias[:, 2] / gain[:, 0]  # kv / kp [s]
