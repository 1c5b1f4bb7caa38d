"""Reads the files of a run's folder, of finished runs and of those that were cut short."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpgrasp.bench.record import ERROR, Task
from mpgrasp.exceptions import OutputError

RUN, EPISODES, SUMMARY = "run.json", "episodes.jsonl", "summary.json"

ALWAYS = (*Task._fields, "seed", "scene_seed", "outcome", "success")
"""Keys of every line."""
PLAYED = ("object", "sim_time_s", "reflex", "state_hash")
"""Keys that the line of an episode has besides, unless it could not be played."""
CLEARING = ("failures", "in_basket", "knocked_off", "left")
"""Keys that a line with `picks` has besides."""


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


def read_complete(path: Path) -> bool | None:
    """Whether summary.json says that a run is complete; None where it is not there or says nothing."""
    try:
        return bool(json.loads((path / SUMMARY).read_text(encoding="utf-8"))["complete"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def read_lines(path: Path) -> Lines:
    """Lines of episodes.jsonl; a last one that a full disk or a kill cut short is set apart.

    Raises:
        OutputError: the file cannot be read, a line before the last is not one of an episode, or one
            lacks a key that all such lines have.
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
        if missing := _missing(line):
            raise OutputError(
                f"{file}, line {number} is not an episode's: it lacks {', '.join(missing)}",
                got=text[:60].decode(errors="replace"),
                allowed="lines as mpgrasp.bench writes them",
            )
        lines.append(line)
        whole += len(text)
    return Lines(lines=lines, whole=whole, torn=None)


def _parse(text: bytes) -> dict[str, Any] | None:
    """A line that holds an object; None for anything else, and for one without its end."""
    try:
        line = json.loads(text)
    except ValueError:
        return None
    return line if isinstance(line, dict) and text.endswith(b"\n") else None


def _missing(line: Mapping[str, Any]) -> list[str]:
    """Keys that a line should have and has not."""
    needed = [*ALWAYS, *(("error",) if line.get("outcome") == ERROR else PLAYED)]
    if "picks" in line:
        needed += CLEARING
    return [key for key in needed if key not in line]
