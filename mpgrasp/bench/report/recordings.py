"""Recordings of runs, as links from the page to the files beside it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.results.runs import Run, Runs

KINDS = {".rrd": "rerun", ".mp4": "MP4", ".gif": "GIF"}
"""Files of a recorded episode, and what they are called."""
MOST = 60
"""Episodes that are linked."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """One recorded episode."""

    text: str
    """Episode and outcome in words."""
    links: Sequence[tuple[str, str]]
    """Name and address, relative to the report, of each file."""


def recordings(runs: Runs, folder: Path | None) -> list[Recording]:
    """Return the recorded episodes of runs; none where it is not known where the report goes.

    Args:
        runs: that the report is about.
        folder: of the report.
    """
    if folder is None:
        return []
    found = [recording for run in runs.runs for recording in _of_run(run, folder.resolve())]
    return found[:MOST]


def _of_run(run: Run, folder: Path) -> list[Recording]:
    kept = run.folder.resolve() / "recordings"
    files = {path.name for path in kept.iterdir()} if kept.is_dir() else set()
    result: list[Recording] = []
    for line in run.lines:
        task = line.task
        links = [
            (name, quote(os.path.relpath(kept / f"{task.stem}{ending}", folder)))
            for ending, name in KINDS.items()
            if f"{task.stem}{ending}" in files
        ]
        if links:
            text = f"{task.suite}: {name_of(task.cell.method)}, episode {task.episode}, {line.outcome}"
            result.append(Recording(text=text, links=links))
        if len(result) == MOST:
            break
    return result
