"""Watch over MuJoCo: what it warns of becomes an error, since what it simulates after that is no result.

MuJoCo warns of a number that is not finite or huge, of a singular inertia, and of contacts or constraints for
which it has no memory. Then it goes on: without the contacts, or with the world back where the model once had
it. The worlds of this project have that reset switched off, and what moves in them is watched.

MuJoCo would also write MUJOCO_LOG.TXT into the working directory. From the import of this module on, warnings
that nobody watches for go to the logger `mujoco` instead; a handler that the program has set before stays.
"""

from __future__ import annotations

import logging
import re
import threading
from types import TracebackType

import mujoco

from mpgrasp.exceptions import SimulationError

_KINDS = tuple(mujoco.mjtWarning(kind) for kind in range(mujoco.mjtWarning.mjNWARNING.value))
_heard = threading.local()  # .messages: list while this thread watches, else None


class Watch:
    """Watches what is done with one state inside of `with watch:`.

    Args:
        model: the world.
        data: its state. What it was warned of counts until `mj_resetData`.

    Raises:
        SimulationError: at the end of the block, where MuJoCo has warned or broken off.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._counters = data.warning

    def __enter__(self) -> None:
        _heard.messages = []

    def __exit__(
        self, _: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        messages: list[str] = _heard.messages
        _heard.messages = None
        found = [self._warning(messages)] if messages or any(self._counters.number) else []
        if isinstance(error, mujoco.FatalError):
            found.append(" ".join(str(error).split()))
            raise SimulationError("the simulator broke off", got="; ".join(found), allowed=_REMEDY) from error
        if found and error is None:
            raise SimulationError("the simulator warned", got=found[0], allowed=_REMEDY)

    def _warning(self, messages: list[str]) -> str:
        """The first warning in MuJoCo's words, with the kinds of all that there were."""
        kinds = [kind for kind in _KINDS if self._counters[kind.value].number]
        names = ", ".join(kind.name.removeprefix("mjWARN_") for kind in kinds) or "WARNING"
        if messages:
            text = messages[0]
        else:  # the program hears the warnings itself
            text = mujoco.mju_warningText(kinds[0].value, self._counters[kinds[0].value].lastinfo)
        return f"{names}: {' '.join(text.split())}{self._joint(text)}"

    def _joint(self, text: str) -> str:
        """Name of the joint that a warning is about, in brackets; empty if about none."""
        found = re.search(r" in (QPOS|QVEL|QACC) at DOF (\d+)", text)
        if found is None:
            return ""
        index, model = int(found[2]), self._model
        if found[1] == "QPOS":  # counted by numbers of the position
            joint = int((model.jnt_qposadr <= index).sum()) - 1
        else:
            joint = int(model.dof_jntid[index])
        return f" ({model.joint(joint).name})"


_REMEDY = "finite numbers of a usual size, and no more contacts than there is memory for"


def forward(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute all that follows from a state.

    Raises:
        SimulationError: MuJoCo has warned or broken off.
    """
    with Watch(model, data):
        mujoco.mj_forward(model, data)


def _hear(message: str) -> None:
    messages = getattr(_heard, "messages", None)
    if messages is None:
        logging.getLogger("mujoco").warning("%s", message)
    else:
        messages.append(message)


if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(_hear)
