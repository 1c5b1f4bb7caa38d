"""`python benchmarks/table.py`: the tables of suites, from the summaries in benchmarks/results/.

`--write` puts them between the two markers of their documents: the paper's suites into README.md, all others
into docs/results.md. A test holds that documents and summaries say the same.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

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
NOT_PLAYED = ""


def cells() -> list[dict[str, Any]]:
    """All published cells, as in the summaries.

    Raises:
        ConfigError: two runs have played the same cell.
    """
    found: list[dict[str, Any]] = []
    source: dict[tuple[str, str, str], Path] = {}
    for path in sorted(RESULTS.glob("*/summary.json")):
        summary = json.loads(path.read_text(encoding="utf-8"))
        assert summary["complete"], f"{path} is the summary of an unfinished run"
        for cell in summary["cells"]:
            key = cell["suite"], cell["detector"], cell["controller"]
            if key in source:
                raise ConfigError(
                    f"two runs have played {'/'.join(key)}",
                    got=[file.parent.name for file in (source[key], path)],
                    allowed="each cell in one published run",
                )
            source[key] = path
            found.append(cell)
    return found


def table(*, paper: bool) -> str:
    """Return the Markdown table of the paper's suites, or of all others.

    It has a row per detector and controller and a column per suite, two where tables are cleared.
    """
    by_key = {
        (c["detector"], c["controller"], c["suite"]): c for c in cells() if (c["suite"] in PAPER) is paper
    }
    suites = sorted({suite for *_, suite in by_key}, key=lambda name: (_rank(name, PAPER), name))
    methods = sorted({key[:2] for key in by_key}, key=lambda m: (_rank(m[0], DETECTORS), *m))
    clearing = {
        suite for *_, suite in by_key if any(c["clearing"] for k, c in by_key.items() if k[2] == suite)
    }
    head = ["detector", "controller"]
    for suite in suites:
        sizes = {c["n"] for key, c in by_key.items() if key[2] == suite}
        assert len(sizes) == 1, f"cells of {suite} have different numbers of episodes: {sizes}"
        what = " cleared" if suite in clearing else ""
        head += [f"{suite}{what} %, n = {sizes.pop()}"] + [f"{suite}, time [s]"] * bool(what)
    lines = [_line(*head), "|" + "---|" * len(head)]
    for method in methods:
        row = list(method)
        for suite in suites:
            cell = by_key.get((*method, suite))
            row += [_rate(cell)] + [_time(cell)] * (suite in clearing)
        lines.append(_line(*row))
    return "\n".join(lines)


def _rank(name: str, order: tuple[str, ...]) -> int:
    return order.index(name) if name in order else len(order)


def _rate(cell: dict[str, Any] | None) -> str:
    if cell is None:
        return NOT_PLAYED
    low, high = (100 * cell[f"wilson_{end}"] for end in ("low", "high"))
    return f"{100 * cell['rate']:.0f} ({low:.0f}-{high:.0f})"


def _time(cell: dict[str, Any] | None) -> str:
    if cell is None:
        return NOT_PLAYED
    return f"{cell['mean_time_s']:.0f} ({cell['mean_time_low']:.0f}-{cell['mean_time_high']:.0f})"


def _line(*values: object) -> str:
    return "| " + " | ".join(str(value) for value in values) + " |"


def main() -> None:
    """Print the tables, or put them into the documents."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"put them into {', '.join(DOCUMENTS)}")
    write = parser.parse_args().write
    for name, paper in DOCUMENTS.items():
        if not write:
            print(f"{name}\n\n{table(paper=paper)}\n")
            continue
        document = ROOT / name
        before, rest = document.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        document.write_text(f"{before}{BEGIN}\n\n{table(paper=paper)}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
