"""Reads the files of a run's folder, of finished runs and of those that were cut short."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpgrasp.bench.plan import Task
from mpgrasp.exceptions import OutputError

RUN, EPISODES = "run.json", "episodes.jsonl"


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Content of an episodes.jsonl."""

    lines: list[dict[str, Any]]
    whole: int
    """Bytes up to the end of the last whole line."""
    torn: bytes | None
    """What stands behind it, if anything."""


def read_run(path: Path) -> dict[str, Any]:
    """Content of run.json.

    Raises:
        OutputError: there is none, or it cannot be read.
    """
    file = path / RUN
    try:
        run = json.loads(file.read_text(encoding="utf-8"))
        run["configuration"]["suite"]  # whatever is no run fails here
    except OSError as error:
        raise OutputError(
            f"no run there ({error.strerror})", got=str(file), allowed="a folder that mpgrasp.bench has made"
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise OutputError("its run.json cannot be read", got=str(path), allowed="JSON of a run") from error
    assert isinstance(run, dict)
    return run


def read_lines(path: Path) -> Lines:
    """Lines of episodes.jsonl; a last one that a full disk or a kill cut short is set apart.

    Raises:
        OutputError: the file cannot be read, or a line before the last is not one of an episode.
    """
    file = path / EPISODES
    try:
        data = file.read_bytes()
    except OSError as error:
        raise OutputError(
            f"no episodes there ({error.strerror})", got=str(file), allowed="a readable file"
        ) from error
    lines: list[dict[str, Any]] = []
    whole = 0
    texts = data.splitlines(keepends=True)
    for number, text in enumerate(texts, 1):
        line = _parse(text)
        if line is None and number < len(texts):
            raise OutputError(
                f"{file}, line {number} is not an episode's", got=text[:60].decode(errors="replace")
            )
        if line is None:
            return Lines(lines=lines, whole=whole, torn=text)
        lines.append(line)
        whole += len(text)
    return Lines(lines=lines, whole=whole, torn=None)


def _parse(text: bytes) -> dict[str, Any] | None:
    """An episode's line; None for anything else, and for one without its end."""
    try:
        line = json.loads(text)
    except ValueError:
        return None
    whole = isinstance(line, dict) and text.endswith(b"\n") and set(Task._fields) <= set(line)
    return line if whole else None
