"""Commands that a report gives to its readers."""

from __future__ import annotations

import shlex
from pathlib import Path

from mpgrasp.bench.record import Task


def replay_command(folder: Path, task: Task) -> str:
    """The command that plays and records one episode of a run again."""
    words = ["python", "-m", "mpgrasp.bench", "replay", str(folder), "--episode", str(task.episode)]
    return shlex.join([*words, "--cell", str(task.cell), "--record"])
