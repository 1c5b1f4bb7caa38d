"""Guard of forked processes, in which what has threads or a driver, such as OpenGL, is dead and hangs.

Whoever starts such a thing says so here. In a process that was forked after that, the same thing is refused
with the remedy. Processes that are spawned, or that a fork server makes, start with nothing.
"""

from __future__ import annotations

import os
import sys

from mpgrasp.exceptions import ConfigError

OPENGL, OPENVINO, TORCH = "OpenGL", "OpenVINO", "torch"
"""Names of what does not survive a fork; torch, which programs start without us, from its import on."""

_started: set[str] = set()
_inherited: set[str] = set()


def starting(what: str) -> None:
    """Note that this process starts `what`.

    Raises:
        ConfigError: the process was forked from one that had started it.
    """
    refuse_inherited(what)
    _started.add(what)


def refuse_inherited(what: str) -> None:
    """Raise ConfigError if this process was forked from one that had started `what`."""
    if what in _inherited:
        raise ConfigError(
            f"{what} was started before this process was forked from another one, and would hang here",
            allowed='AsyncVectorEnv(..., context="spawn") or "forkserver", or fork before it is used',
        )


def refuse_inherited_torch() -> None:
    """Raise ConfigError if torch was imported before a fork and has more than one thread to hang on."""
    import torch

    if torch.get_num_threads() > 1:
        refuse_inherited(TORCH)


def _after_fork() -> None:
    _inherited.update(_started)
    if TORCH in sys.modules:
        _inherited.add(TORCH)


if hasattr(os, "register_at_fork"):  # not on Windows, which does not fork
    os.register_at_fork(after_in_child=_after_fork)
