"""Reads the files of a run's folder, of finished runs and of those that were cut short."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpgrasp.bench.analysis.summary import RunSummary
from mpgrasp.bench.record import Row, line_of, record_of
from mpgrasp.bench.results.run_card import RunDescription
from mpgrasp.bench.stored_lines import StoredLines, read_stored_lines
from mpgrasp.exceptions import ConfigError, OutputError

RUN, EPISODES, SUMMARY = "run.json", "episodes.jsonl", "summary.json"


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Content of an episodes.jsonl."""

    lines: StoredLines
    whole: int
    """Bytes up to the end of the last whole line."""
    torn: bytes | None
    """Bytes behind it, if there are any."""


def read_run(path: Path) -> RunDescription:
    """Content of a folder's run.json.

    Raises:
        OutputError: there is none, or it cannot be used: no JSON, an unknown or a missing key, a wrong type.
    """
    file = path / RUN
    try:
        return _read_record(file, RunDescription)
    except OSError as error:
        raise OutputError(
            f"no run there ({error.strerror})", got=str(file), allowed="a folder that mpgrasp.bench has made"
        ) from error


def read_summary(path: Path) -> RunSummary | None:
    """Content of a folder's summary.json; None where there is none.

    Raises:
        OutputError: it cannot be read or used: no JSON, an unknown or a missing key, a wrong type.
    """
    file = path / SUMMARY
    try:
        return _read_record(file, RunSummary)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(
            f"cannot be read ({error.strerror})", got=str(file), allowed="a readable file"
        ) from error


def read_complete(path: Path) -> bool | None:
    """Return what summary.json says about a run being complete; None where it is not there or unusable."""
    try:
        summary = read_summary(path)
    except OutputError:
        return None
    return None if summary is None else summary.complete


def _read_record(file: Path, kind: type[Row]) -> Row:
    try:
        return record_of(kind, json.loads(file.read_text(encoding="utf-8")))
    except ConfigError as error:
        raise OutputError(f"{file} {error}", allowed="a file as mpgrasp.bench writes it") from error
    except ValueError as error:
        raise OutputError(f"{file} cannot be used: {error}", allowed="JSON, in UTF-8") from error


def read_lines(path: Path) -> Lines:
    """Lines of episodes.jsonl; a last one that a full disk or a kill cut short is set apart.

    Raises:
        OutputError: the file cannot be read, or a line is not one of an episode: no JSON, an unknown or a
            missing key, a wrong type. It names file and number of the line.
    """
    file = path / EPISODES
    try:
        lines, whole, other = read_stored_lines(file)
    except OSError as error:
        raise OutputError(
            f"no episodes there ({error.strerror})", got=str(file), allowed="a readable file"
        ) from error
    if other is None:
        return Lines(lines=lines, whole=whole, torn=None)
    row = _parse(other.content)
    if row is None and other.is_last:
        return Lines(lines=lines, whole=whole, torn=other.content)
    raise OutputError(
        f"{file}, line {other.number} is not an episode's ({_what_is_wrong(row)})",
        got=other.content[:60].decode(errors="replace"),
        allowed="lines as mpgrasp.bench writes them",
    )


def _what_is_wrong(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return "it is no object of JSON"
    try:
        line_of(row)
    except ConfigError as error:
        return str(error)
    return "JSON has no such number"  # NaN or an infinity


def _parse(text: bytes) -> Mapping[str, Any] | None:
    """A line that holds an object; None for anything else, and for one without its end."""
    try:
        row = json.loads(text)
    except ValueError:
        return None
    return row if isinstance(row, dict) and text.endswith(b"\n") else None
