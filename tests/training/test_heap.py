"""A process that keeps its memory asks the system for a large buffer once, not every time."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

PROGRAMME = """
import resource, sys
import numpy as np
from mpgrasp.training.heap import keep_memory
if sys.argv[1] == "kept":
    assert keep_memory()
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
np.ones(16 * 2**20)
before = faults()
for _ in range(10):
    np.ones(16 * 2**20)
print(faults() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="mallopt is glibc's")
def test_a_large_buffer_is_taken_from_the_system_once() -> None:
    kept, usual = (
        int(subprocess.run([sys.executable, "-c", PROGRAMME, how], capture_output=True, check=True).stdout)
        for how in ("kept", "usual")
    )
    assert kept < 0.2 * usual
