"""Contacts of the gripper's pads: the objects that press against their faces."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from mpgrasp.linear_algebra import dot
from mpgrasp.robot import panda

_NO_OBJECT = -1
PAD_FACE_COSINE = 0.5
"""A pad is touched by its face if the contact normal is within 60 degrees of the closing direction: wider
than any friction cone here, and blind to what a tip stands on."""


class PadContacts:
    """Reads the pads' contacts of one `MjData`.

    Args:
        model: world with the hand under the prefix `panda/`.
        data: its state; a forward pass must have been made.
        objects: names of the objects' bodies.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, objects: Sequence[str]) -> None:
        self._model, self._data, self._objects = model, data, tuple(objects)
        self._tcp = model.site(panda.PREFIX + "tcp").id
        self._pads = [model.geom(panda.PREFIX + name).id for name in ("left_pad", "right_pad")]
        self._wrench = np.zeros(6)
        index = {model.body(name).id: i for i, name in enumerate(self._objects)}
        owner = np.full(model.nbody, _NO_OBJECT)
        for body in range(1, model.nbody):  # parents come before children
            owner[body] = index.get(body, owner[model.body_parentid[body]])
        self._owner = owner[model.geom_bodyid]

    def objects(self) -> tuple[set[str], set[str]]:
        """Names of the objects that press against the face of the left and of the right pad."""
        touched: tuple[set[str], set[str]] = (set(), set())
        contact = self._data.contact
        geom = contact.geom  # (ncon, 2)
        owner = self._owner[geom].max(axis=1, initial=_NO_OBJECT)
        closing = self._data.site_xmat[self._tcp].reshape(3, 3)[:, 1]
        for side, pad in enumerate(self._pads):
            for i in np.flatnonzero((geom == pad).any(axis=1) & (owner >= 0)).tolist():
                if abs(dot(contact.frame[i, :3], closing)) > PAD_FACE_COSINE and self._normal_force(i) > 0:
                    touched[side].add(self._objects[owner[i]])
        return touched

    def _normal_force(self, contact: int) -> float:
        mujoco.mj_contactForce(self._model, self._data, contact, self._wrench)
        return float(self._wrench[0])
