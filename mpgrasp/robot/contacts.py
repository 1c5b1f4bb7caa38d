"""Contacts of the gripper's fingers: the objects that they press, and those that they hold.

Whole fingers count, not their pads alone: a roll of tape is clamped as well by the parts above the pads. What
hangs on closed fingers holds no finger back: the grip force goes into the fingers' own stops, however hard a
shake has jammed it onto their diagonals.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from mpgrasp.geometry import FloatArray
from mpgrasp.linear_algebra import dot, norm
from mpgrasp.robot import hand, panda

_NONE = -1
_SIDES = ("left", "right")
FACE_COSINE = 0.5
"""A finger presses along the closing direction if the contact normal is within 60 degrees of it: wider than
any friction cone here, and blind to what a tip stands on."""
LEAST_FORCE = 5.0
"""Force from either side below which even a feather is not held [N]. Closed fingers press what lies between
with the grip force, 30 N or more; a light object that hangs on them wedges itself with up to 1.4 N."""


class FingerContacts:
    """Reads the fingers' contacts of one `MjData`.

    Args:
        model: world with the hand under the prefix `panda/`.
        data: its state; a forward pass must have been made.
        objects: names of the objects' bodies.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, objects: Sequence[str]) -> None:
        self._model, self._data, self._objects = model, data, tuple(objects)
        self._tcp = model.site(panda.PREFIX + "tcp").id
        self._wrench = np.zeros(6)
        self._joints = [int(model.joint(panda.PREFIX + name).qposadr[0]) for name in panda.FINGER_JOINTS]
        bodies = [model.body(name).id for name in self._objects]
        fingers = [model.body(f"{panda.PREFIX}{side}_finger").id for side in _SIDES]
        self._object_of = _owners(model, bodies)[model.geom_bodyid]
        self._finger_of = _owners(model, fingers)[model.geom_bodyid]
        weight = model.body_subtreemass[bodies] * norm(model.opt.gravity)
        # A body of weight W that lies on both diagonals, 30 degrees from upright, is pressed with W cos 30
        # from either side, less than W. The cap lies above the weight of all that the arm can carry, 3 kg.
        self._needed = np.clip(weight, LEAST_FORCE, hand.GRIPPER_FORCE_MIN)

    def forces(self) -> dict[str, FloatArray]:
        """Forces (2,) with which the left and the right finger press an object, by name [N].

        Each is the sum of the normal forces' components along the closing direction, inwards positive, over
        all contacts whose normal lies within 60 degrees of it. Objects without such a contact are left out.
        """
        found: dict[str, FloatArray] = {}
        contact = self._data.contact
        geom = contact.geom  # (ncon, 2)
        finger = self._finger_of[geom].max(axis=1, initial=_NONE)
        owner = self._object_of[geom].max(axis=1, initial=_NONE)
        closing = self._data.site_xmat[self._tcp].reshape(3, 3)[:, 1]  # towards the left finger
        for i in np.flatnonzero((finger >= 0) & (owner >= 0)).tolist():
            along = dot(contact.frame[i, :3], closing)
            if abs(along) <= FACE_COSINE or (force := self._normal_force(i)) <= 0:
                continue
            # the normal points from the first geom to the second, which is pushed along it
            push = force * along * (1 if self._object_of[geom[i, 1]] >= 0 else -1)
            inwards = -push if finger[i] == 0 else push
            found.setdefault(self._objects[owner[i]], np.zeros(2))[finger[i]] += inwards
        return found

    def held(self) -> set[str]:
        """Names of the objects that hold the fingers apart, pressed from both sides harder than they weigh.

        That is at least the weight, but no less than `LEAST_FORCE` and no more than `hand.GRIPPER_FORCE_MIN`.
        None is held by fingers that rest on their own stops.
        """
        if self._data.qpos[self._joints].sum() <= 0:
            return set()
        needed = dict(zip(self._objects, self._needed, strict=True))
        return {name for name, sides in self.forces().items() if sides.min() >= needed[name]}

    def _normal_force(self, contact: int) -> float:
        mujoco.mj_contactForce(self._model, self._data, contact, self._wrench)
        return float(self._wrench[0])


def _owners(model: mujoco.MjModel, bodies: Sequence[int]) -> NDArray[np.int64]:
    """Return for every body (nbody,) the index in `bodies` of the one that it belongs to, or -1."""
    index = {body: i for i, body in enumerate(bodies)}
    owner = np.full(model.nbody, _NONE)
    for body in range(1, model.nbody):  # parents come before children
        owner[body] = index.get(body, owner[model.body_parentid[body]])
    return owner
