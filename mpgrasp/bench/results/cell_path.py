"""Names a run, or one cell of it, on a command line: RUN or RUN/DETECTOR/CONTROLLER."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from mpgrasp.bench.record import Cells, by_cell
from mpgrasp.bench.results.reader import RUN, read_lines
from mpgrasp.exceptions import ConfigError


class CellName(NamedTuple):
    """What a cell is called within its run."""

    suite: str
    detector: str
    controller: str

    def __str__(self) -> str:
        return f"{self.detector}/{self.controller}"


def find_cell(cells: Iterable[tuple[str, str, str]], text: str) -> CellName:
    """The one cell that is called DETECTOR/CONTROLLER, or SUITE/DETECTOR/CONTROLLER.

    Raises:
        ConfigError: none, or several.
    """
    names = [CellName(*cell) for cell in cells]
    found = [name for name in names if text in (str(name), f"{name.suite}/{name}")]
    if len(found) != 1:
        wrong = "no such cell" if not found else "several cells of that name"
        raise ConfigError(wrong, got=text, allowed=[f"{name.suite}/{name}" for name in names])
    return found[0]


def read_cells(text: str) -> tuple[Path, Cells]:
    """The folder and the cells of a run, or its one cell that the end of the path names.

    Raises:
        ConfigError, OutputError: no such run or cell.
    """
    path = Path(text)
    folder = next((p for p in (path, *path.parents) if (p / RUN).is_file()), path)
    lines: list[Mapping[str, Any]] = list(read_lines(folder).lines)
    cells = by_cell(lines)
    if folder == path:
        return folder, cells
    name = find_cell(cells, path.relative_to(folder).as_posix())
    return folder, {name: cells[name]}
