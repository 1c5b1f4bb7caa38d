"""Memory of a training on a CPU: buffers of its layers stay with the process from step to step.

glibc hands every large buffer back to the system and asks for it anew, and each new page costs a fault, layer
by layer. Reference: mallopt(3).
"""

from __future__ import annotations

import ctypes
import platform

_TRIM_THRESHOLD, _TOP_PAD, _MMAP_MAX = -1, -2, -4  # of malloc.h
_NEVER = 2**31 - 1
_SPARE = 2**28
"""Memory that is asked of the system at a time, at least [bytes]."""


def keep_memory() -> bool:
    """Have this process keep what it frees; True where that is possible, with glibc.

    It holds for all of the process, until its end: for commands, not for a library that others call.
    """
    if platform.libc_ver()[0] != "glibc":
        return False
    mallopt = ctypes.CDLL(None).mallopt
    return all(
        mallopt(*pair) == 1 for pair in ((_MMAP_MAX, 0), (_TRIM_THRESHOLD, _NEVER), (_TOP_PAD, _SPARE))
    )
