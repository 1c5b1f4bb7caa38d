"""The Franka Hand's drive: moves to a width, or closes until both pads press with a force."""

from __future__ import annotations

import mujoco
import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.robot import hand, panda


class GripperDrive:
    """Drives the gripper of one `MjData`, one `update` per time step.

    Args:
        model: world with the hand attached under the prefix `panda/`.
        data: its state.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        finger = model.joint(panda.PREFIX + panda.FINGER_JOINTS[0])
        q, v = int(finger.qposadr[0]), int(finger.dofadr[0])
        actuator = model.actuator(panda.PREFIX + "gripper").id
        # Both fingers follow one another; slices give views, quick to write to.
        self._qpos, self._qvel = data.qpos[q : q + 2], data.qvel[v : v + 2]
        self._ctrl = data.ctrl[actuator : actuator + 1]
        self._stiffness = float(model.actuator_gainprm[actuator, 0])
        self._dt = float(model.opt.timestep)
        self.force: float | None = None
        """Force of each pad while grasping [N]; None while the gripper holds a width."""
        self.target = hand.GRIPPER_MAX_WIDTH
        """Commanded opening [m]."""

    @property
    def width(self) -> float:
        """Opening between the pads [m]."""
        return float(self._qpos[0] + self._qpos[1])

    def set_width(self, width: float) -> None:
        """Teleport the fingers to an opening [m], at rest, and hold it."""
        self._qpos[:] = width / 2
        self._qvel[:] = 0.0
        self._ctrl[0] = width
        self.open(width)

    def open(self, width: float) -> None:
        """Move to an opening [m], wider or narrower, at `hand.GRIPPER_SPEED`; cut at the hand's limits."""
        self.force = None
        self.target = float(np.clip(width, 0.0, hand.GRIPPER_MAX_WIDTH))

    def close(self, force: float) -> None:
        """Close at `hand.GRIPPER_CLOSE_SPEED` until both pads press with `force` [N], whatever the width.

        Raises:
            ConfigError: a force that the hand cannot hold continuously.
        """
        if not hand.GRIPPER_FORCE_MIN <= force <= hand.GRIPPER_FORCE_MAX:
            raise ConfigError(
                "grip force out of range",
                got=force,
                allowed=f"{hand.GRIPPER_FORCE_MIN} to {hand.GRIPPER_FORCE_MAX} N",
            )
        self.force = float(force)

    def update(self) -> None:
        """Set the servo's reference for the next time step."""
        reference = float(self._ctrl[0])
        if self.force is None:
            limit = hand.GRIPPER_SPEED * self._dt
            reference += min(max(self.target - reference, -limit), limit)
        else:
            # The servo pulls with its stiffness times the lag: let it lag by the force asked for.
            floor = self.width - self.force / self._stiffness
            reference = max(reference - hand.GRIPPER_CLOSE_SPEED * self._dt, floor)
        self._ctrl[0] = reference
