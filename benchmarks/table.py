"""`python benchmarks/table.py`: the results table of the README, from the summaries in benchmarks/results/.

`--write` puts it between the two markers in README.md; a test holds that both say the same.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
BEGIN, END = "<!-- results: python benchmarks/table.py --write -->", "<!-- end of results -->"
COLUMNS = (
    "suite", "detector", "controller", "n", "success %", "95 % interval", "median time [s]", "reflex stops",
    "failures",
)  # fmt: skip


def rows() -> list[str]:
    """One Markdown row per published cell, in the order of suite, detector, controller."""
    cells = []
    for path in sorted(RESULTS.glob("*/summary.json")):
        summary = json.loads(path.read_text(encoding="utf-8"))
        assert summary["complete"], f"{path} is the summary of an unfinished run"
        cells += summary["cells"]
    order = {"oracle": 0, "dhrnet": 1}
    cells.sort(key=lambda c: (c["suite"], order.get(c["detector"], 9), c["detector"], c["controller"]))
    return [_row(cell) for cell in cells]


def _row(cell: dict) -> str:
    failures = ", ".join(f"{count} {cause}" for cause, count in sorted(cell["failures"].items())) or "none"
    interval = f"{100 * cell['wilson_low']:.1f} - {100 * cell['wilson_high']:.1f}"
    return _line(
        cell["suite"],
        cell["detector"],
        cell["controller"],
        cell["n"],
        f"{100 * cell['rate']:.0f}",
        interval,
        f"{cell['median_time_s']:.1f}",
        cell["reflex_stops"],
        failures,
    )


def _line(*values: object) -> str:
    return "| " + " | ".join(str(value) for value in values) + " |"


def table() -> str:
    """The whole Markdown table."""
    return "\n".join([_line(*COLUMNS), "|" + "---|" * len(COLUMNS), *rows()])


def main() -> None:
    """Print the table, or put it into the README."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="put it into README.md")
    if not parser.parse_args().write:
        print(table())
        return
    readme = ROOT / "README.md"
    text = readme.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    readme.write_text(f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
