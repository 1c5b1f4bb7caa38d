"""Results of an evaluation: a table, a plot, rows for pandas, and a folder that can be kept."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from mpgrasp.bench.analysis.summary import CellSummary, PairedTest
from mpgrasp.bench.record import Line
from mpgrasp.bench.results.reader import read_lines, read_summary
from mpgrasp.exceptions import ConfigError, OutputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 80
"""Width of a table of text."""


class Results(Sequence[Line]):
    """Episodes of a run with what they add up to; as a sequence, its episodes in order.

    Args:
        folder: of the run.
        kept: what removes the folder when the results go; None for a folder that stays.

    Raises:
        OutputError: no run is there.
    """

    def __init__(self, folder: Path | str, *, kept: TemporaryDirectory[str] | None = None) -> None:
        self.folder, self._kept = Path(folder), kept
        summary = read_summary(self.folder)
        if summary is None:
            raise OutputError(
                "no finished run there", got=str(folder), allowed="a folder of a run that ended"
            )
        self.episodes = read_lines(self.folder).lines
        """Lines of episodes.jsonl."""
        self.cells: tuple[CellSummary, ...] = summary.cells
        """A summary of each detector with each controller in each suite."""
        self.paired_tests: tuple[PairedTest, ...] = summary.paired_tests
        """McNemar's exact tests of every two of them, over the worlds that both met."""
        self.complete = summary.complete
        """False if an episode could not be played."""

    def __len__(self) -> int:
        return len(self.episodes)

    def __getitem__(self, place: Any) -> Any:
        return self.episodes[place]

    def __iter__(self) -> Iterator[Line]:
        return iter(self.episodes)

    def cell(self, detector: str, controller: str | None = None, suite: str | None = None) -> CellSummary:
        """Return the summary of a detector, with a controller and in a suite where there are several.

        Raises:
            ConfigError: there is none, or more than one.
        """
        wanted = {"detector": detector, "controller": controller, "suite": suite}
        found = [
            cell
            for cell in self.cells
            if all(value is None or getattr(cell, key) == value for key, value in wanted.items())
        ]
        if len(found) != 1:
            said = {key: value for key, value in wanted.items() if value is not None}
            raise ConfigError(
                f"{len(found)} cells of that name", got=said, allowed=[str(cell.cell) for cell in self.cells]
            )
        return found[0]

    def table(self) -> str:
        """Return successes with 95 % Wilson intervals, times, stops and failures, one row per cell."""
        from rich.box import SIMPLE_HEAD
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        grid = Table(box=SIMPLE_HEAD, padding=(0, 1), collapse_padding=True)
        rows = self._rows()
        for heading in rows[0]:
            left = heading in ("suite", "detector", "controller", "failures")
            grid.add_column(heading, justify="left" if left else "right", overflow="fold")
        for row in rows[1:]:
            grid.add_row(*map(escape, row))
        text = io.StringIO()
        Console(file=text, width=COLUMNS, force_terminal=False).print(grid)
        return "\n".join(line.rstrip() for line in text.getvalue().strip("\n").splitlines())

    def _rows(self) -> list[tuple[str, ...]]:
        several = len({cell.suite for cell in self.cells}) > 1
        head = ("detector", "controller", "n", "success %", "95 %", "time s", "failures")
        rows = [(*(("suite",) if several else ()), *head)]
        for cell in self.cells:
            rate = "-" if cell.rate is None else f"{100 * cell.rate:.1f}"
            interval = f"{100 * cell.wilson_low:.0f}-{100 * cell.wilson_high:.0f}"
            time = "-" if cell.median_time_s is None else f"{cell.median_time_s:.1f}"
            failures = ", ".join(f"{count} {name}" for name, count in cell.failures.items()) or "none"
            if cell.errors:
                failures += f", {cell.errors} errors"
            row = (cell.detector, cell.controller, str(cell.n), rate, interval, time, failures)
            rows.append((*((cell.suite,) if several else ()), *row))
        return rows

    def __repr__(self) -> str:
        return self.table()

    def _repr_html_(self) -> str:
        from markupsafe import Markup

        head, *body = self._rows()
        cells = Markup("").join(Markup("<th>{}</th>").format(cell) for cell in head)
        rows = Markup("").join(
            Markup("<tr>{}</tr>").format(Markup("").join(Markup("<td>{}</td>").format(cell) for cell in row))
            for row in body
        )
        return str(Markup("<table><thead><tr>{}</tr></thead><tbody>{}</tbody></table>").format(cells, rows))

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw success rates with their 95 % intervals, best first, into `axes` or a new figure."""
        import matplotlib.pyplot as plt

        axes = axes or plt.subplots(figsize=(7, 0.8 + 0.35 * len(self.cells)), layout="constrained")[1]
        ranked = sorted(self.cells, key=lambda cell: cell.rate or 0)
        several = len({cell.suite for cell in self.cells}) > 1
        for k, cell in enumerate(ranked):
            axes.plot([100 * cell.wilson_low, 100 * cell.wilson_high], [k, k], color="C0", lw=2)
            axes.plot(100 * (cell.rate or 0), k, "o", color="C0")
        names = [f"{c.suite}: {c.cell.method}" if several else str(c.cell.method) for c in ranked]
        axes.set(xlim=(-2, 102), xlabel="success [%], 95 % Wilson intervals", yticks=range(len(ranked)))
        axes.set_yticklabels(names)
        return axes

    def to_dataframe(self) -> Any:
        """Return a pandas DataFrame with a row per episode; nested values become columns with dots.

        Raises:
            ConfigError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError:
            raise ConfigError("no pandas here", allowed="pip install pandas; or list(results)") from None
        return pandas.json_normalize([line.as_row() for line in self.episodes])

    def save(self, folder: Path | str) -> Path:
        """Copy the run into a folder: run.json, episodes.jsonl, summary.json, report.html and recordings.

        Raises:
            OutputError: it is there already, or cannot be written.
        """
        target = Path(folder)
        try:
            if target.exists() and any(target.iterdir()):
                raise OutputError("a folder that is not empty", got=str(target), allowed="another folder")
            shutil.copytree(self.folder, target, dirs_exist_ok=True)
        except OSError as error:
            raise OutputError(f"results cannot be saved: {error}", got=str(target)) from error
        return target
