"""Bits of an episode do not depend on the kernel that numpy's BLAS picks for a processor."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

# instruction sets that a kernel needs, as numpy names them
KERNELS = {"Prescott": "X86_V2", "Haswell": "X86_V3", "SkylakeX": "X86_V4"}

PRODUCT = """
import numpy as np
a, b = np.random.default_rng(1).standard_normal((2, 60, 60))
print((a @ b).tobytes().hex())
"""
EPISODES = """
from mpgrasp.controllers import make_controller
from mpgrasp.detectors import make_detector
from mpgrasp.episode import run_episode
from mpgrasp.suite import load_suite
for suite, controller in (("thin", "mppc"), ("single", "mvp_robust")):
    players = dict(detector=make_detector("oracle"), controller=make_controller(controller))
    result = run_episode(load_suite(suite).scenes[0], 5, **players)
    print(result.outcome, result.state_hash, result.min_singular_value)
"""


def printed(program: str, kernel: str) -> str:
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    return run.stdout


def kernels_here() -> list[str]:
    found = np.show_config(mode="dicts")["SIMD Extensions"]
    here = {*found["baseline"], *found.get("found", [])}
    return [name for name, needed in KERNELS.items() if needed in here]


@pytest.mark.skipif(len(kernels_here()) < 2, reason="this processor has one kernel alone")
def test_episodes_are_equal_bit_for_bit_under_every_kernel_of_the_blas() -> None:
    kernels = kernels_here()
    if len({printed(PRODUCT, kernel) for kernel in kernels}) == 1:
        pytest.skip("numpy's BLAS has one kernel alone")
    assert len({printed(EPISODES, kernel) for kernel in kernels}) == 1
