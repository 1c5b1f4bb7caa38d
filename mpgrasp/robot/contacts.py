"""Who touches whom, and how hard: the contacts of a world, sorted by owner."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from mpgrasp.robot import panda

_ELSEWHERE = -1
_ROBOT = -2
PAD_FACE_COSINE = 0.5
"""A pad is touched by its face if the contact normal is within 60 degrees of the closing direction: wider
than any friction cone here, and blind to what a tip stands on."""


class Contacts:
    """Reads the contacts of one `MjData`.

    Args:
        model: world with the robot attached under the prefix `panda/`.
        data: its state; a forward pass must have been made.
        objects: names of the objects' bodies.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, objects: Sequence[str]) -> None:
        self._model, self._data, self._objects = model, data, tuple(objects)
        self._tcp = model.site(panda.PREFIX + "tcp").id
        self._wrench = np.zeros(6)
        index = {model.body(name).id: i for i, name in enumerate(self._objects)}
        hand = model.body(panda.PREFIX + "hand").id
        owner, is_hand = np.full(model.nbody, _ELSEWHERE), np.zeros(model.nbody, bool)
        for body in range(1, model.nbody):  # parents come before children
            parent = model.body_parentid[body]
            if model.body(body).name.startswith(panda.PREFIX):
                owner[body] = _ROBOT
            else:
                owner[body] = index.get(body, owner[parent])
            is_hand[body] = body == hand or is_hand[parent]
        self._owner, self._is_hand = owner[model.geom_bodyid], is_hand[model.geom_bodyid]
        self._pads = [model.geom(panda.PREFIX + name).id for name in ("left_pad", "right_pad")]

    def pads(self) -> tuple[set[str], set[str]]:
        """Names of the objects that press against the face of the left and of the right pad."""
        touched: tuple[set[str], set[str]] = (set(), set())
        contact = self._data.contact
        geom = contact.geom  # (ncon, 2)
        owner = self._owner[geom].max(axis=1, initial=_ELSEWHERE)
        closing = self._data.site_xmat[self._tcp].reshape(3, 3)[:, 1]
        for side, pad in enumerate(self._pads):
            for i in np.flatnonzero((geom == pad).any(axis=1) & (owner >= 0)).tolist():
                if abs(contact.frame[i, :3] @ closing) > PAD_FACE_COSINE and self._normal_force(i) > 0:
                    touched[side].add(self._objects[owner[i]])
        return touched

    def robot_force(self) -> float:
        """Largest normal force [N] between one geom of the robot and one that is not the robot's."""
        return self._largest_force(self._owner == _ROBOT)

    def hand_force(self) -> float:
        """The same for the hand, the camera and the fingers only [N]."""
        return self._largest_force(self._is_hand)

    def _largest_force(self, part: np.ndarray) -> float:
        geom = self._data.contact.geom
        outward = (self._owner[geom] == _ROBOT).sum(axis=1) == 1
        forces: dict[tuple[int, int], float] = {}
        for i in np.flatnonzero(outward & part[geom].any(axis=1)).tolist():
            # the contact points between two geoms share the load
            pair = (int(geom[i, 0]), int(geom[i, 1]))
            forces[pair] = forces.get(pair, 0.0) + self._normal_force(i)
        return max(forces.values(), default=0.0)

    def _normal_force(self, contact: int) -> float:
        mujoco.mj_contactForce(self._model, self._data, contact, self._wrench)
        return float(self._wrench[0])
