"""`python -m mpgrasp.bench compare A B`: is B worse than A over the worlds that both met?"""

from __future__ import annotations

import math
from argparse import RawDescriptionHelpFormatter
from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table

from mpgrasp.bench.cell_path import CellName, read_cells
from mpgrasp.bench.command_line import Parser
from mpgrasp.bench.pairing import Pairing, pair
from mpgrasp.bench.report import wide_console
from mpgrasp.bench.run_files import read_run
from mpgrasp.bench.statistics import SIGNIFICANCE, holm
from mpgrasp.bench.summary import Cells
from mpgrasp.exceptions import ConfigError
from mpgrasp.plain import difference

EXIT_WORSE = 1
_SHARED = ("suite", "episode", "seed", "camera", "noise")
"""Parts of a configuration that two runs should agree in to be compared."""

_EPILOG = """\
A and B are folders of runs, or single cells of them: RUN/DETECTOR/CONTROLLER. Cells of the same name are
compared; where there is one on each side, it may have any name. Episodes are paired by suite, seed and
number. p is McNemar's exact test, two-sided; with several cells it is corrected after Holm.

exit code: 0 B is not significantly worse, 1 B is (p < 0.05), 2 unusable input.
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench compare",
        description="Set two runs side by side, as a regression check.",
        epilog=_EPILOG,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("a", metavar="A", help="the reference")
    parser.add_argument("b", metavar="B", help="what is checked against it")
    return parser


def compare(a: Cells, b: Cells) -> list[tuple[CellName, CellName, Pairing, float]]:
    """(cell of A, cell of B, their pairing, p after Holm's correction) for all cells in common.

    Raises:
        ConfigError: no cell or no episode in common.
    """
    if len(a) == len(b) == 1:
        couples = [(next(iter(a)), next(iter(b)))]
    else:
        couples = [(name, name) for name in a if name in b]
    pairings = [(CellName(*x), CellName(*y), pair(a[x], b[y])) for x, y in couples]
    pairings = [found for found in pairings if found[2].n]
    if not pairings:
        raise ConfigError(
            "the runs have no episode in common",
            got=[[f"{n.suite}/{n}" for n in map(CellName._make, cells)] for cells in (a, b)],
            allowed="cells of the same names or one on each side, with the same suite and seed",
        )
    corrected = holm([pairing.p for _, _, pairing in pairings])
    return [(*found, p) for found, p in zip(pairings, corrected, strict=True)]


def main(command: Sequence[str]) -> int:
    """Print the comparison and return the exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    arguments = make_parser().parse_args(command)
    (folder_a, a), (folder_b, b) = read_cells(arguments.a), read_cells(arguments.b)
    rows = compare(a, b)
    table = Table(box=SIMPLE_HEAD, padding=(0, 0), collapse_padding=True, header_style="bold")
    for heading in ("suite", "A", "B"):
        table.add_column(heading, overflow="fold")
    for heading in (
        "n", "A %", "B %", "A alone", "B alone", "p", "B - A, s\n(95 %)", "same\noutcome", "bit for\nbit",
    ):  # fmt: skip
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict")
    worse = False
    for cell_a, cell_b, found, p in rows:
        significant = p < SIGNIFICANCE
        worse |= significant and found.rate_b < found.rate_a
        table.add_row(
            cell_a.suite, str(cell_a), str(cell_b), str(found.n),
            f"{100 * found.rate_a:.1f}", f"{100 * found.rate_b:.1f}",
            str(found.a_alone), str(found.b_alone), f"{p:.3g}", _time(found),
            str(found.same_outcome), str(found.identical), _verdict(found, significant),
        )  # fmt: skip
    print(f"A = {folder_a}\nB = {folder_b}")
    before, after = (read_run(folder)["configuration"] for folder in (folder_a, folder_b))
    for key in _SHARED:
        text = difference(before.get(key), after.get(key), key)
        if text:
            print(f"Not the same in both: {text.replace(' there', ' in A').replace(' here', ' in B')}")
    wide_console().print(table)
    return EXIT_WORSE if worse else 0


def _verdict(found: Pairing, significant: bool) -> str:
    if not significant:
        return "no significant difference"
    return "B is better" if found.rate_b > found.rate_a else "B is worse"


def _time(found: Pairing) -> str:
    if math.isnan(found.time_difference_s):
        return "-"
    bounds = "" if math.isnan(found.time_low) else f" ({found.time_low:+.1f} to {found.time_high:+.1f})"
    return f"{found.time_difference_s:+.1f}{bounds}"
