"""Lines of an episodes.jsonl that stay in their file: each is read when it is asked for.

A million lines are about a gigabyte of text, and five of Python objects. What is kept in memory is where each
line begins and which episode it is about: 21 bytes a line.
"""

from __future__ import annotations

import os
import weakref
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, overload

import msgspec
import numpy as np
from numpy.typing import NDArray

from mpgrasp.bench.record import Cell, Cells, ClearingLine, ErrorLine, GraspLine, Line, Task

IN_MEMORY = 1 << 24
"""Files of fewer bytes are kept in memory as they are."""

_KINDS: tuple[msgspec.json.Decoder[Line], ...] = tuple(
    msgspec.json.Decoder(kind) for kind in (GraspLine, ClearingLine, ErrorLine)
)
_ERROR = 2  # place of ErrorLine among them
_BLOCK = 1 << 20  # bytes that are read at a time

Places = NDArray[np.intp]
"""Numbers of lines in a file, from 0."""


class Text(NamedTuple):
    """A piece of a file that is no line of an episode."""

    number: int
    """Of the line, from 1."""
    content: bytes
    is_last: bool
    """True if nothing follows."""


class StoredLines(Sequence[Line]):
    """Lines of a file in some order, or some of them; made with `read_stored_lines`."""

    def __init__(self, index: _Index, places: Places) -> None:
        self._index, self._places = index, places

    def __len__(self) -> int:
        return len(self._places)

    @overload
    def __getitem__(self, place: int) -> Line: ...
    @overload
    def __getitem__(self, place: slice) -> StoredLines: ...
    def __getitem__(self, place: int | slice) -> Line | StoredLines:
        if isinstance(place, slice):
            return self._taken(self._places[place])
        return self._index.line(self._places[place])

    def __iter__(self) -> Iterator[Line]:
        return map(self._index.line, self._places)

    def tasks(self) -> Iterator[Task]:
        """Episodes that the lines are about, in their order."""
        return map(self._index.task, self._places)

    def by_cell(self) -> Cells:
        """Lines by cell, in order of first appearance."""
        numbers = self._index.cells_of(self._places)
        found, first = np.unique(numbers, return_index=True)
        return {
            self._index.cells[number]: self._taken(self._places[numbers == number])
            for number in found[np.argsort(first)]
        }

    def latest(self) -> StoredLines:
        """One line of each episode, the last of its results, or else the first of its errors."""
        cells, episodes = self._index.cells_of(self._places), self._index.episodes_of(self._places)
        order = np.lexsort((episodes, cells))  # of one episode's lines, the first comes first
        steps = (np.diff(numbers[order], prepend=-1) != 0 for numbers in (cells, episodes))
        begins = np.flatnonzero(np.logical_or(*steps))
        if not len(begins):
            return self
        results = np.where(self._index.is_error(self._places[order]), -1, order)
        last_result, first = np.maximum.reduceat(results, begins), order[begins]
        kept = np.where(last_result < 0, first, last_result)
        return self._taken(self._places[kept[np.argsort(first)]])

    def in_order(self, key: Callable[[Task], Any]) -> StoredLines:
        """The lines in the order of a key of their episodes."""
        keys = [key(task) for task in self.tasks()]
        return self._taken(self._places[sorted(range(len(keys)), key=keys.__getitem__)])

    def played_tasks(self) -> TaskSet:
        """Episodes of which there is a result."""
        return TaskSet(self._taken(self._places[~self._index.is_error(self._places)]).tasks())

    def _taken(self, places: Places) -> StoredLines:
        return StoredLines(self._index, places)


class TaskSet:
    """A set of episodes."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        self._episodes: dict[Cell, set[int]] = {}
        for task in tasks:
            self._episodes.setdefault(task.cell, set()).add(task.episode)

    def __contains__(self, task: Task) -> bool:
        return task.episode in self._episodes.get(task.cell, ())


def read_stored_lines(file: Path) -> tuple[StoredLines, int, Text | None]:
    """Go through a file, up to its end or to the first text that is no line of an episode.

    Returns:
        The lines, the bytes that they take up, and that text, if there is any.

    Raises:
        OSError: the file cannot be read.
    """
    index = _Index(file)
    return StoredLines(index, np.arange(len(index))), index.end, index.no_line


def by_cell(lines: Iterable[Line]) -> Cells:
    """Lines by cell, in order of first appearance."""
    if isinstance(lines, StoredLines):
        return lines.by_cell()
    cells: dict[Cell, list[Line]] = {}
    for line in lines:
        cells.setdefault(line.task.cell, []).append(line)
    return {**cells}


class _Index:
    """Where each line of a file begins, of what kind it is, and which episode it is about."""

    def __init__(self, file: Path) -> None:
        self.cells: list[Cell] = []
        """In order of first appearance."""
        self.end = 0
        """Bytes up to the end of the last line."""
        self.no_line: Text | None = None
        self._starts, self._episodes = array("q"), array("q")
        self._kinds, self._cells = array("b"), array("i")
        self._read = _Content(file).read
        numbers: dict[Cell, int] = {}
        for text, is_last in self._texts():
            kind, task = _kind_and_task(text)
            if task is None:
                self.no_line = Text(len(self) + 1, text, is_last)
                break
            self._starts.append(self.end)
            self._kinds.append(kind)
            self._cells.append(numbers.setdefault(task.cell, len(numbers)))
            self._episodes.append(task.episode)
            self.end += len(text)
        self.cells = list(numbers)

    def _texts(self) -> Iterator[tuple[bytes, bool]]:
        """Pieces of the file with their line ends; True with the last one."""
        rest, at = b"", 0
        while block := self._read(at, _BLOCK):
            at += len(block)
            *whole, rest = (rest + block).splitlines(keepends=True)
            yield from ((text, False) for text in whole)
        if rest:
            yield rest, True

    def __len__(self) -> int:
        return len(self._starts)

    def line(self, place: int) -> Line:
        """Read a line."""
        start = self._starts[place]
        stop = self._starts[place + 1] if place + 1 < len(self) else self.end
        return _KINDS[self._kinds[place]].decode(self._read(start, stop - start))

    def task(self, place: int) -> Task:
        """The episode that a line is about, which is known without reading it."""
        cell = self.cells[self._cells[place]]
        return Task(cell.suite, self._episodes[place], cell.detector, cell.controller)

    def cells_of(self, places: Places) -> NDArray[np.int32]:
        """(n,) numbers of the cells of lines."""
        return np.frombuffer(self._cells, np.int32)[places] if len(self) else np.empty(0, np.int32)

    def episodes_of(self, places: Places) -> NDArray[np.int64]:
        """(n,) numbers of the episodes of lines."""
        return np.frombuffer(self._episodes, np.int64)[places] if len(self) else np.empty(0, np.int64)

    def is_error(self, places: Places) -> NDArray[np.bool_]:
        """(n,) True for lines of episodes that could not be played."""
        kinds = np.frombuffer(self._kinds, np.int8) if len(self) else np.empty(0, np.int8)
        return np.equal(kinds[places], _ERROR)


def _kind_and_task(text: bytes) -> tuple[int, Task | None]:
    """Place of a line's kind in `_KINDS`, and its episode; None where it is no line."""
    if text.endswith(b"\n"):
        for kind, decoder in enumerate(_KINDS):
            try:
                return kind, decoder.decode(text).task
            except (msgspec.MsgspecError, UnicodeDecodeError):
                continue
    return 0, None


class _Content:
    """Bytes of a file, even if another one takes its place meanwhile."""

    def __init__(self, file: Path) -> None:
        self._stream = stream = file.open("rb", buffering=0)
        self._data: bytes | None = None
        close = weakref.finalize(self, stream.close)
        if os.fstat(stream.fileno()).st_size < IN_MEMORY:
            self._data = stream.readall()
            close()

    def read(self, start: int, n: int) -> bytes:
        """Read at most n bytes from there on."""
        if self._data is not None:
            return self._data[start : start + n]
        return os.pread(self._stream.fileno(), n, start)
