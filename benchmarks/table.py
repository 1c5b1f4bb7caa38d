"""`python benchmarks/table.py`: the tables of suites, from the summaries in benchmarks/results/.

`--write` puts them between the two markers of their documents: the paper's suites into README.md, all others
into docs/results.md. A test holds that documents and summaries say the same.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from mpgrasp.bench.analysis.paper import QUOTED
from mpgrasp.bench.analysis.summary import CellSummary
from mpgrasp.bench.record import Cell
from mpgrasp.bench.results.reader import read_summary
from mpgrasp.command_line import Parser, run_command
from mpgrasp.exceptions import ConfigError

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
BEGIN, END = "<!-- results: python benchmarks/table.py --write -->", "<!-- end of results -->"
PAPER = ("single", "unseen", "thin", "stacked")
"""Suites of the paper's tables, in their order."""
DOCUMENTS = {"README.md": True, "docs/results.md": False}
"""Documents with a table; True for the table of the paper's suites, False for that of all others."""
DETECTORS = ("oracle", "dhrnet", "tfgrasp", "ggcnn", "ggcnn2")
"""Order of the rows; other detectors come after these."""
ONLY_SINGLE = {"grconvnet", *(name for names in QUOTED.values() for name in names)}
"""Detectors that have played `single` alone, of these suites; they are left out of the README's table."""
NOT_PLAYED = ""


def cells() -> dict[Cell, CellSummary]:
    """All published cells, as in the summaries; runs with other settings than the suite's are left out.

    Raises:
        ConfigError: two runs have played the same cell.
        OutputError: a summary that cannot be used.
    """
    found: dict[Cell, CellSummary] = {}
    source: dict[Cell, Path] = {}
    for folder in sorted(path.parent for path in RESULTS.glob("*/summary.json")):
        if _has_other_settings(folder):
            continue
        summary = read_summary(folder)
        assert summary is not None
        assert summary.complete, f"{folder} holds an unfinished run"
        for row in summary.cells:
            if row.cell in source:
                raise ConfigError(
                    f"two runs have played {row.cell}",
                    got=[source[row.cell].name, folder.name],
                    allowed="each cell in one published run",
                )
            source[row.cell], found[row.cell] = folder, row
    return found


def _has_other_settings(folder: Path) -> bool:
    run = folder / "run.json"
    return run.is_file() and "--set" in json.loads(run.read_text(encoding="utf-8"))["command"].split()


def table(*, paper: bool) -> str:
    """Return the Markdown table of the paper's suites, or of all others.

    That of the paper's suites, for the README, has the robust controllers with DHRNet alone, and one floor;
    docs/results.md has all of them. A table has a row per detector and controller and a column per suite, two
    where tables are cleared.
    """
    rows = {
        cell: row
        for cell, row in cells().items()
        if (cell.suite in PAPER) is paper and not (paper and _is_left_out(cell))
    }
    suites = sorted({cell.suite for cell in rows}, key=lambda name: (_rank(name, PAPER), name))
    methods = sorted({cell.method for cell in rows}, key=lambda m: (_rank(m.detector, DETECTORS), *m))
    clearing = {cell.suite for cell, row in rows.items() if row.clearing}
    head = ["detector", "controller"]
    for suite in suites:
        sizes = {row.n for cell, row in rows.items() if cell.suite == suite}
        assert len(sizes) == 1, f"cells of {suite} have different numbers of episodes: {sizes}"
        what = " cleared" if suite in clearing else ""
        head += [f"{suite}{what} %, n = {sizes.pop()}"] + [f"{suite}, time [s]"] * bool(what)
    lines = [_line(*head), "|" + "---|" * len(head)]
    for method in methods:
        texts = list(method)
        for suite in suites:
            found = rows.get(Cell(suite, *method))
            texts += [_rate(found)] + [_time(found)] * (suite in clearing)
        lines.append(_line(*texts))
    return "\n".join(lines)


def _is_left_out(cell: Cell) -> bool:
    robust = cell.controller.endswith("_robust") and cell.detector != DETECTORS[1]
    # straight_down is the floor
    return robust or cell.controller == "open_loop" or cell.detector in ONLY_SINGLE


def _rank(name: str, order: tuple[str, ...]) -> int:
    return order.index(name) if name in order else len(order)


def _rate(row: CellSummary | None) -> str:
    if row is None or row.rate is None:
        return NOT_PLAYED
    return f"{100 * row.rate:.0f} ({100 * row.wilson_low:.0f}-{100 * row.wilson_high:.0f})"


def _time(row: CellSummary | None) -> str:
    if row is None or row.mean_time_s is None:
        return NOT_PLAYED
    return f"{row.mean_time_s:.0f} ({row.mean_time_low:.0f}-{row.mean_time_high:.0f})"


def _line(*values: object) -> str:
    return "| " + " | ".join(str(value) for value in values) + " |"


def main(command: Sequence[str] | None = None) -> int:
    """Print the tables, or put them into the documents; return the exit code, 2 for bad input."""
    return run_command(lambda: _write(command))


def _write(command: Sequence[str] | None) -> int:
    parser = Parser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put them into {', '.join(DOCUMENTS)}")
    write = parser.parse_args(command).write
    for name, paper in DOCUMENTS.items():
        if not write:
            print(f"{name}\n\n{table(paper=paper)}\n")
            continue
        document = ROOT / name
        before, rest = document.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        document.write_text(f"{before}{BEGIN}\n\n{table(paper=paper)}\n\n{END}{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
