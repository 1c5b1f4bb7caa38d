"""A scene in motion with the robot's hand in it, whatever carries the hand: the arm, or nothing at all."""

from __future__ import annotations

from abc import ABC, abstractmethod

import mujoco

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, transform
from mpgrasp.robot import hand
from mpgrasp.robot.contacts import FingerContacts
from mpgrasp.robot.gripper import GripperDrive
from mpgrasp.scene.scene import Scene
from mpgrasp.scene.watch import Watch


class MovingScene(ABC):
    """One scene in motion: its time, its objects, and the gripper among them.

    Args:
        scene: with the hand in it under the prefix `panda/`.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.model: mujoco.MjModel = scene.model
        self.data = mujoco.MjData(self.model)
        self._watch = Watch(self.model, self.data)
        self._gripper = GripperDrive(self.model, self.data)
        self._finger_contacts = FingerContacts(self.model, self.data, scene.objects)
        self._stale = False  # True while poses and contacts lag behind the joint positions

    @property
    @abstractmethod
    def T_world_tcp(self) -> FloatArray:
        """Pose (4, 4) of the tool point."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.data.time)

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

    def finger_forces(self) -> dict[str, FloatArray]:
        """Forces (2,) with which the left and the right finger press an object inwards, by name [N]."""
        self.refresh()
        return self._finger_contacts.forces()

    def held(self) -> set[str]:
        """Names of the objects that the fingers clamp from both sides."""
        self.refresh()
        return self._finger_contacts.held()

    def object_pose(self, name: str) -> FloatArray:
        """Pose (4, 4) of an object's body frame in the world.

        Raises:
            ConfigError: the scene has no such object.
        """
        if name not in self.scene.objects:
            raise ConfigError("unknown object", got=name, allowed=self.scene.objects)
        self.refresh()
        body = self.data.body(name)
        return transform(body.xmat.reshape(3, 3), body.xpos)

    def refresh(self) -> None:
        """Bring poses and contacts up to the joint positions, where they lag behind.

        Raises:
            SimulationError: MuJoCo warns of the state.
        """
        if self._stale:
            with self._watch:
                mujoco.mj_forward(self.model, self.data)
            self._stale = False
