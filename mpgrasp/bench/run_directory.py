"""The folder of one run: run.json, episodes.jsonl, summary.json, recordings/.

A line of episodes.jsonl is on the disk before the next episode begins, whatever happens then.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mpgrasp.exceptions import OutputError
from mpgrasp.plain import difference, one_line, plain


class RunDirectory:
    """Writes a run; made with `RunDirectory.create`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.recordings = path / "recordings"
        self._episodes: int | None = None

    @classmethod
    def create(cls, path: Path, run: Mapping[str, Any]) -> RunDirectory:
        """A folder for a new run, with its run.json.

        A folder that holds a run with the same `configuration` is taken over: its episodes.jsonl is
        kept as episodes.previous.jsonl, in place of one that may be there.

        Args:
            path: the folder; it is made if need be.
            run: content of run.json; its `configuration` says what is being run.

        Raises:
            OutputError: a folder that cannot be written, or that holds another run.
        """
        new = cls(path)
        content = plain(run)
        try:
            path.mkdir(parents=True, exist_ok=True)
            new._refuse_other_run(content["configuration"])
            new._write("run.json", content)
            new.recordings.mkdir(exist_ok=True)
            if new.episodes_file.exists():
                os.replace(new.episodes_file, path / "episodes.previous.jsonl")
            (path / "summary.json").unlink(missing_ok=True)
            new._episodes = os.open(new.episodes_file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise _not_writable(path, error) from error
        return new

    @property
    def episodes_file(self) -> Path:
        """One line of JSON per episode."""
        return self.path / "episodes.jsonl"

    def append(self, line: Mapping[str, Any]) -> None:
        """Add one episode: in a single write, and on the disk on return.

        Raises:
            OutputError: the disk is full or gone. What was there before stays whole.
        """
        assert self._episodes is not None
        data = one_line(line).encode()
        try:
            size = os.fstat(self._episodes).st_size
            if os.write(self._episodes, data) < len(data):
                os.ftruncate(self._episodes, size)
                raise OSError("disk full")
            os.fsync(self._episodes)
        except OSError as error:
            raise _not_writable(self.episodes_file, error) from error

    def episodes(self) -> list[dict[str, Any]]:
        """All lines so far.

        Raises:
            OutputError: a line that is not JSON.
        """
        lines = []
        for number, text in enumerate(self.episodes_file.read_text(encoding="utf-8").splitlines(), 1):
            try:
                lines.append(json.loads(text))
            except ValueError as error:
                raise OutputError(
                    f"{self.episodes_file}, line {number} is not JSON", got=text[:60]
                ) from error
        return lines

    def write_summary(self, cells: Sequence[Mapping[str, Any]], *, complete: bool) -> None:
        """Write summary.json.

        Args:
            cells: rows of `statistics.summarise`.
            complete: whether all planned episodes are in.

        Raises:
            OutputError: the file cannot be written.
        """
        try:
            self._write("summary.json", {"complete": complete, "cells": plain(list(cells))})
        except OSError as error:
            raise _not_writable(self.path / "summary.json", error) from error

    def write_text(self, name: str, text: str) -> Path:
        """Write a text file into the folder.

        Raises:
            OutputError: the file cannot be written.
        """
        try:
            (self.path / name).write_text(text, encoding="utf-8")
        except OSError as error:
            raise _not_writable(self.path / name, error) from error
        return self.path / name

    def close(self) -> None:
        """Close episodes.jsonl."""
        if self._episodes is not None:
            os.close(self._episodes)
            self._episodes = None

    def _refuse_other_run(self, configuration: Any) -> None:
        file = self.path / "run.json"
        if file.exists():
            try:
                found = difference(
                    json.loads(file.read_text(encoding="utf-8"))["configuration"], configuration
                )
            except (ValueError, KeyError, TypeError):
                found = "its run.json cannot be read"
        elif self.episodes_file.exists():
            found = "episodes.jsonl without a run.json"
        else:
            return
        if found:
            raise OutputError(
                f"directory already holds another run ({found})",
                got=str(self.path),
                allowed="a new directory, or the same configuration again",
            )

    def _write(self, name: str, content: Any) -> None:
        """Replace a JSON file as a whole, so that there is never half of one."""
        temporary = self.path / f".{name}.tmp"
        temporary.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        os.replace(temporary, self.path / name)


def _not_writable(path: Path, error: OSError) -> OutputError:
    reason = error.strerror or str(error)
    return OutputError(f"cannot be written ({reason})", got=str(path), allowed="a directory one may write to")
