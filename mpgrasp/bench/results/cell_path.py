"""Names a run, or one cell of it, on a command line: RUN or RUN/DETECTOR/CONTROLLER."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from mpgrasp.bench.record import Cell, Cells
from mpgrasp.bench.results.reader import RUN, read_lines
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.exceptions import ConfigError


def find_cell(cells: Iterable[Cell], text: str) -> Cell:
    """The one cell that is called DETECTOR/CONTROLLER, or SUITE/DETECTOR/CONTROLLER.

    Raises:
        ConfigError: none, or several.
    """
    cells = list(cells)
    found = [cell for cell in cells if text in (str(cell.method), str(cell))]
    if len(found) != 1:
        wrong = "no such cell" if not found else "several cells of that name"
        raise ConfigError(wrong, got=text, allowed=cells)
    return found[0]


def read_cells(text: str) -> tuple[Path, Cells]:
    """The folder and the cells of a run, or its one cell that the end of the path names.

    Raises:
        ConfigError, OutputError: no such run or cell.
    """
    path = Path(text)
    folder = next((p for p in (path, *path.parents) if (p / RUN).is_file()), path)
    cells = by_cell(read_lines(folder).lines)
    if folder == path:
        return folder, cells
    cell = find_cell(cells, path.relative_to(folder).as_posix())
    return folder, {cell: cells[cell]}


def choose_cell(cells: Sequence[Cell], name: str | None) -> Cell:
    """Return the cell of that name, or the only one where none is given.

    Args:
        cells: of a run.
        name: [suite/]detector/controller.

    Raises:
        ConfigError: no such cell, or several and no name.
    """
    if name is None and len(cells) > 1:
        alike = len({cell.suite for cell in cells}) == 1
        names = [str(cell.method if alike else cell) for cell in cells]
        raise ConfigError("the run has several cells", allowed=[f"--cell {name}" for name in names])
    return find_cell(cells, name or str(cells[0]))
