"""Processor that computes, and the kernels that libraries pick for it: together they decide the last bits."""

from __future__ import annotations

import platform
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info

_CPU_INFO = Path("/proc/cpuinfo")


def processor() -> str:
    """Return the name of the processor; empty where the system does not tell it."""
    try:
        lines = _CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor())


def instruction_sets() -> list[str]:
    """Return the groups of instructions that numpy uses here, as it names them."""
    found: Any = np.show_config(mode="dicts")
    extensions = found.get("SIMD Extensions", {})
    return [*extensions.get("baseline", []), *extensions.get("found", [])]


def blas_kernels() -> list[str]:
    """Return numpy's BLAS with its version and kernel; all that are loaded where numpy shares one of them."""
    loaded = [item for item in threadpool_info() if item["user_api"] == "blas"]
    own = [item for item in loaded if "numpy" in item["filepath"]]
    return sorted(
        " ".join(str(item[key]) for key in ("internal_api", "version", "architecture") if item.get(key))
        for item in own or loaded
    )
