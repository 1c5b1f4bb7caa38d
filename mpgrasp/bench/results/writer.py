"""The folder of one run: run.json, episodes.jsonl, summary.json, errors/, recordings/.

A line of episodes.jsonl is on the disk as soon as its episode is finished, and whole or absent whatever
happens then. While a run lasts, lines stand in the order in which they were finished; when it ends, they
are put into the order of the plan.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from mpgrasp.bench.analysis.summary import RunSummary
from mpgrasp.bench.record import ErrorLine, Line, Record, played, text_of
from mpgrasp.bench.results.reader import EPISODES, RUN, SUMMARY, read_complete, read_lines, read_run
from mpgrasp.bench.results.run_card import Configuration, Resumption, RunDescription
from mpgrasp.bench.stored_lines import StoredLines
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.files.json_values import differences
from mpgrasp.names import printable


class RunDirectory:
    """Writes a run; made with `RunDirectory.create` or `RunDirectory.resume`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.recordings = path / "recordings"
        self._lock: int | None = None
        self._episodes: int | None = None

    @classmethod
    def create(cls, path: Path, run: RunDescription, planned: int | None = None) -> RunDirectory:
        """A folder for a new run, with its run.json.

        A folder that holds a complete run with the same `configuration` is taken over: its
        episodes.jsonl is kept as episodes.previous.jsonl, the next as episodes.previous-2.jsonl, ...

        Args:
            path: the folder; it is made if need be.
            run: content of run.json.
            planned: number of episodes that such a run has when it is complete; None if it depends on
                their results.

        Raises:
            OutputError: a folder that cannot be written, or that holds another run, or one that is not
                complete.
        """
        new = cls(path)
        with new._taking_over():
            path.mkdir(parents=True, exist_ok=True)
            new._claim()
            new._refuse_other_run(run.configuration)
            new._refuse_unfinished_run(planned)
            new._write(RUN, run)
            new._keep_old_lines()
            (path / SUMMARY).unlink(missing_ok=True)
            new._open()
        return new

    @classmethod
    def resume(cls, path: Path, run: RunDescription, note: Callable[[str], None]) -> RunDirectory:
        """The folder of a run that was interrupted, to be finished.

        A last line that is not whole is cut off. run.json gets an entry in `resumed`, with what the rest
        is made with where that has changed.

        Args:
            path: the folder.
            run: what run.json would say of a new run.
            note: is told in words what was repaired and what has changed.

        Raises:
            OutputError: no run to finish, one with another configuration, or a folder that cannot be
                written.
        """
        new, before = cls(path), read_run(path)
        found = before.configuration.difference(run.configuration)
        if found:
            raise OutputError(
                f"cannot resume with another configuration ({found.words('there', 'here')})",
                got=str(path),
                allowed="the configuration that the run began with, or another directory",
            )
        changed = list(differences(before.made_with.as_row(), run.made_with.as_row()))
        if changed:
            words = "; ".join(place.words("there", "here") for place in changed)
            note(f"not made with the same as the finished episodes ({words})")
        resumption = Resumption(started=run.started, made_with=run.made_with if changed else None)
        with new._taking_over():
            new._claim()
            if new.episodes_file.exists():
                new._repair(note)
            new._write(RUN, msgspec.structs.replace(before, resumed=(*before.resumed, resumption)))
            new._open()
        return new

    @property
    def episodes_file(self) -> Path:
        """One line of JSON per episode."""
        return self.path / EPISODES

    def append(self, line: Line) -> None:
        """Add one episode: in a single write, and on the disk on return.

        Args:
            line: of the episode; the traceback of an error goes to a file of its own in errors/, and the line
                names it.

        Raises:
            OutputError: the disk is full or gone. What was there before stays whole.
        """
        assert self._episodes is not None
        try:
            if isinstance(line, ErrorLine):
                trace = Path("errors") / f"{line.task.stem}.txt"
                (self.path / trace).parent.mkdir(exist_ok=True)
                (self.path / trace).write_text(line.traceback, encoding="utf-8")
                line = msgspec.structs.replace(line, traceback=str(trace))
            data = text_of(line).encode()
            size = os.fstat(self._episodes).st_size
            try:
                if os.write(self._episodes, data) < len(data):
                    raise OSError("disk full")
                os.fsync(self._episodes)
            except OSError:
                with suppress(OSError):
                    os.ftruncate(self._episodes, size)
                raise
        except OSError as error:
            raise _not_writable(self.episodes_file, error) from error

    def episodes(self) -> StoredLines:
        """One line per episode so far, in the order of the file; a result counts more than an error.

        Raises:
            OutputError: a line that is not one of an episode.
        """
        return read_lines(self.path).lines.latest()

    def settle(self, lines: Iterable[Line]) -> None:
        """Write all lines anew, in their final order; nothing can be appended any more.

        Raises:
            OutputError: the file cannot be written anew; the old one stays as it is.
        """
        try:
            replace_file(self.episodes_file, map(text_of, lines))
        except OSError as error:
            raise _not_writable(self.episodes_file, error) from error
        self._close_episodes()  # it is the old file's

    def write_summary(self, summary: RunSummary) -> None:
        """Write summary.json.

        Raises:
            OutputError: the file cannot be written.
        """
        try:
            self._write(SUMMARY, summary)
        except OSError as error:
            raise _not_writable(self.path / SUMMARY, error) from error

    def close(self) -> None:
        """Let go of the folder."""
        self._close_episodes()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @contextmanager
    def _taking_over(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.close()
            raise _not_writable(self.path, error) from error
        except OutputError:
            self.close()
            raise

    def _claim(self) -> None:
        """Keep other processes from writing here; the claim ends with this process at the latest."""
        self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise OutputError(
                "another process is writing to this directory", got=str(self.path), allowed="one at a time"
            ) from error
        except OSError:
            pass  # a file system without locks

    def _open(self) -> None:
        self.recordings.mkdir(exist_ok=True)
        self._episodes = os.open(self.episodes_file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)

    def _close_episodes(self) -> None:
        if self._episodes is not None:
            os.close(self._episodes)
            self._episodes = None

    def _repair(self, note: Callable[[str], None]) -> None:
        found = read_lines(self.path)
        if found.torn is None:
            return
        with self.episodes_file.open("r+b") as file:
            file.truncate(found.whole)
            os.fsync(file.fileno())
        note(
            f"the last line of {self.episodes_file} was not whole ({found.torn[:40]!r}...) and is cut off; "
            f"its episode is played again"
        )

    def _refuse_other_run(self, configuration: Configuration) -> None:
        if (self.path / RUN).exists():
            try:
                differs = read_run(self.path).configuration.difference(configuration)
                found = differs and differs.words("there", "here")
            except OutputError as error:
                found = str(error)
        elif self.episodes_file.exists():
            found = "episodes.jsonl without a run.json"
        # a kill may leave an unfinished run.json behind, under a hidden name
        elif others := sorted(path.name for path in self.path.iterdir() if path.name[0] != "."):
            shown = ", ".join(map(printable, others[:3])) + (", ..." if len(others) > 3 else "")
            raise OutputError(
                f"directory is not empty and holds no run ({shown})",
                got=str(self.path),
                allowed="a new or an empty directory",
            )
        else:
            return
        if found:
            raise OutputError(
                f"directory already holds another run ({found})",
                got=str(self.path),
                allowed="a new directory, or the same configuration again",
            )

    def _refuse_unfinished_run(self, planned: int | None) -> None:
        """A run that has cost hours is not begun anew because its command was given twice."""
        if read_complete(self.path) or not self.episodes_file.exists():
            return
        lines = self.episodes()
        if lines:
            raise OutputError(
                f"directory already holds this run, unfinished ({sum(1 for _ in played(lines))} "
                f"{'' if planned is None else f'of {planned} '}episodes are there)",
                got=str(self.path),
                allowed=f"--resume {self.path}, or another --out",
            )

    def _keep_old_lines(self) -> None:
        """Put episodes.jsonl aside, if there is anything in it, under a name that is free."""
        if not (self.episodes_file.exists() and self.episodes_file.stat().st_size):
            return
        number, aside = 1, self.path / "episodes.previous.jsonl"
        while aside.exists():
            number += 1
            aside = self.path / f"episodes.previous-{number}.jsonl"
        os.replace(self.episodes_file, aside)

    def _write(self, name: str, content: Record) -> None:
        replace_file(self.path / name, json.dumps(content.as_row(), indent=2, allow_nan=False) + "\n")


def _not_writable(path: Path, error: OSError) -> OutputError:
    reason = error.strerror or str(error)
    return OutputError(f"cannot be written ({reason})", got=str(path), allowed="a directory one may write to")
