"""`python -m mpgrasp.bench compare A B`: is B worse than A over the worlds that both met?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from mpgrasp.bench.analysis.pairing import Pairing, pair, pair_worlds
from mpgrasp.bench.analysis.tally import restricted_time
from mpgrasp.bench.record import Cell, Cells, ClearingLine, Line
from mpgrasp.bench.report.terminal_tables import wide_console
from mpgrasp.bench.results.cell_path import read_cells
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.run_card import Card, Configuration, SuitePart
from mpgrasp.command_line import Parser
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.json_values import Difference, differences
from mpgrasp.statistics import SIGNIFICANCE, holm, restricted, wilcoxon
from mpgrasp.suite import METHOD_GROUPS, base_name

EXIT_WORSE = 1
_SHARED = ("seed", "camera", "noise")
"""Parts of a configuration that two runs should agree in to be compared, beside their common suites."""

_EPILOG = """\
A and B are folders of runs, or single cells of them: RUN/DETECTOR/CONTROLLER. Cells of the same name are
compared; where there is one on each side, it may have any name. Episodes are paired by suite, seed and
number. Success: McNemar's exact test. Where tables are cleared, also the times, cut off at the limit, which
is what a table that was not cleared counts as: Wilcoxon's signed-rank test. Both are two-sided, and p is
corrected after Holm over all tests.

exit code: 0 B is not worse, 1 B is: it succeeds less often or takes longer (p < 0.05), or has errors in
episodes that A played; 2 unusable input.
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench compare",
        description="Set two runs side by side, as a regression check.",
        epilog=_EPILOG,
    )
    parser.add_argument("a", metavar="A", help="the reference")
    parser.add_argument("b", metavar="B", help="what is checked against it")
    return parser


@dataclass(frozen=True, kw_only=True)
class TimeTest:
    """Test of the times in which two cells cleared the same tables, cut off at the limit."""

    mean_a: float
    """Mean time; a table that was not cleared counts as the limit [s]."""
    mean_b: float
    """[s]"""
    p: float
    """Two-sided p of Wilcoxon's signed-rank test."""
    slower: bool
    """True if B's times tend to be the longer ones, significantly or not."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A cell of A beside one of B."""

    a: Cell
    b: Cell
    pairing: Pairing
    times: TimeTest | None
    """None unless both cleared tables."""
    p_success: float = math.nan
    """p of McNemar's test after Holm's correction; NaN where there is no episode that both played."""
    p_times: float = math.nan

    @property
    def differences(self) -> dict[str, bool]:
        """Significant differences of B in words, True where they make B worse; empty if there are none."""
        found = {}
        if self.p_success < SIGNIFICANCE:
            worse = self.pairing.rate_b < self.pairing.rate_a
            found["B is worse" if worse else "B is better"] = worse
        if self.times is not None and self.p_times < SIGNIFICANCE:
            found["B is slower" if self.times.slower else "B is faster"] = self.times.slower
        if self.pairing.lost:
            found["B has errors"] = True
        return found


def unequal_conditions(
    before: Configuration, after: Configuration, suites: Iterable[tuple[str, str]]
) -> list[Difference]:
    """Differences of two configurations in what decides the worlds and the episodes that both played.

    Args:
        before: configuration of A.
        after: configuration of B.
        suites: that are compared, one of A with one of B.
    """
    one, other = before.as_row(), after.as_row()
    found = [changed for key in _SHARED for changed in differences(one[key], other[key], key)]
    ours, theirs = ({part.suite.name: part for part in run.parts} for run in (before, after))
    couples = dict.fromkeys((name, to) for name, to in suites if name in ours and to in theirs)
    for name, to in couples:
        a, b = ours[name], theirs[to]
        settings = list(differences(*_common_settings(a.settings, b.settings), name))
        found += settings or list(differences(_declared(a, b), _declared(b, a), name))[:1]
    return found


def _common_settings(a: Card, b: Card) -> tuple[Card, Card]:
    """Settings of two runs in the groups that both have, and there of what plays in both."""
    groups = [group for group in a if a[group] is not None and b.get(group) is not None]
    ours, theirs = ({group: settings[group] for group in groups} for settings in (a, b))
    for settings in (ours, theirs):  # the switch of the noise is one of `_SHARED`
        settings["episode"] = {k: v for k, v in settings.get("episode", {}).items() if k not in _SHARED}
    for group in (group for group in groups if group in METHOD_GROUPS):
        names = [name for name in a[group] if name in b[group]]
        ours[group], theirs[group] = ({name: settings[group][name] for name in names} for settings in (a, b))
    return ours, theirs


def _declared(part: SuitePart, other: SuitePart) -> Card:
    """Declaration of a suite without what it has for what plays, and what both runs keep of its episodes."""
    suite = {key: value for key, value in part.suite.as_row().items() if key not in METHOD_GROUPS}
    suite["name"] = base_name(part.suite.name)
    shared = [key for key in part.episode if key in other.episode and key not in _SHARED]
    return {"suite": suite, "episode": {key: part.episode[key] for key in shared}}


def compare(a: Cells, b: Cells) -> list[Comparison]:
    """All cells in common, with p after Holm's correction over all tests of all of them.

    Raises:
        ConfigError: no cell or no episode in common.
    """
    if len(a) == len(b) == 1:
        couples = [(next(iter(a)), next(iter(b)))]
    else:
        couples = [(name, name) for name in a if name in b]
    rows = [
        Comparison(a=x, b=y, pairing=pair(a[x], b[y]), times=compare_times(a[x], b[y])) for x, y in couples
    ]
    rows = [row for row in rows if row.pairing.n or row.pairing.lost]
    if not rows:
        raise ConfigError(
            "the runs have no episode in common",
            got=[[str(cell) for cell in cells] for cells in (a, b)],
            allowed="cells of the same names or one on each side, with the same suite and seed",
        )
    success = [row.pairing.p for row in rows if row.pairing.n]
    corrected = holm([*success, *(row.times.p for row in rows if row.times)])
    of_success, of_times = iter(corrected[: len(success)]), iter(corrected[len(success) :])
    return [
        replace(
            row,
            p_success=next(of_success) if row.pairing.n else math.nan,
            p_times=next(of_times) if row.times else math.nan,
        )
        for row in rows
    ]


def compare_times(a: Sequence[Line], b: Sequence[Line]) -> TimeTest | None:
    """Test the times of two cells over the tables that both had to clear; None if there are none."""
    pairs = [
        (x.time_limit_s, y.time_limit_s, restricted_time(x), restricted_time(y))
        for x, y in pair_worlds(a, b) if isinstance(x, ClearingLine) and isinstance(y, ClearingLine)
    ]  # fmt: skip
    if not pairs:
        return None
    limits_a, limits_b, *times = np.array(pairs, float).T
    limit = float(min(limits_a.min(), limits_b.min()))  # the same for A and B
    times_a, times_b = (restricted(side, limit) for side in times)
    p, slower = wilcoxon(times_b - times_a)
    return TimeTest(mean_a=float(times_a.mean()), mean_b=float(times_b.mean()), p=p, slower=slower)


def main(command: Sequence[str]) -> int:
    """Print the comparison and return the exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    arguments = make_parser().parse_args(command)
    (folder_a, a), (folder_b, b) = read_cells(arguments.a), read_cells(arguments.b)
    rows = compare(a, b)
    print(f"A = {folder_a}\nB = {folder_b}")
    before, after = (read_run(folder) for folder in (folder_a, folder_b))
    suites = [(row.a.suite, row.b.suite) for row in rows]
    for changed in unequal_conditions(before.configuration, after.configuration, suites):
        print(f"Not the same in both: {changed.words('in A', 'in B')}")
    for changed in differences(before.made_with.as_row(), after.made_with.as_row()):
        print(f"Not made with the same: {changed.words('in A', 'in B')}")
    for side, cells, shown in (("A", a, {row.a for row in rows}), ("B", b, {row.b for row in rows})):
        alone = [str(cell) for cell in cells if cell not in shown]
        if alone:
            print(f"In {side} alone, so not compared: {', '.join(alone)}")
    wide_console().print(_table(rows))
    lost = [(row.pairing.lost, row.pairing.lost + row.pairing.n, row.b) for row in rows if row.pairing.lost]
    if lost:
        text = ", ".join(f"{k} of {n} of {cell}" for k, n, cell in lost)
        print(f"B is worse: episodes that A played are errors in B: {text}")
    return EXIT_WORSE if any(worse for row in rows for worse in row.differences.values()) else 0


def _table(rows: Sequence[Comparison]) -> Table:
    errors = any(row.pairing.errors_a or row.pairing.errors_b for row in rows)
    times = any(row.times for row in rows)
    table = Table(box=SIMPLE_HEAD, padding=(0, 0), collapse_padding=True, header_style="bold")
    for heading in ("suite", "A", "B"):
        table.add_column(heading, overflow="fold")
    for heading in (
        "n", *(["errors\nA, B"] if errors else []), "A %", "B %", "A alone", "B alone", "p",
        "B - A, s\n(95 %)", *(["A, s", "B, s", "p of\ntimes"] if times else []),
        "same\noutcome", "bit for\nbit",
    ):  # fmt: skip
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict")
    for row in rows:
        found = row.pairing
        table.add_row(
            escape(" / ".join(dict.fromkeys((row.a.suite, row.b.suite)))),
            escape(str(row.a.method)), escape(str(row.b.method)), str(found.n),
            *([f"{found.errors_a}, {found.errors_b}"] if errors else []),
            _number(100 * found.rate_a), _number(100 * found.rate_b), str(found.a_alone), str(found.b_alone),
            _number(row.p_success, ".3g"), _time(found), *(_clearing(row) if times else []),
            str(found.same_outcome), str(found.identical),
            ", ".join(row.differences) or "no significant difference",
        )  # fmt: skip
    return table


def _clearing(row: Comparison) -> list[str]:
    if row.times is None:
        return ["-"] * 3
    return [_number(row.times.mean_a), _number(row.times.mean_b), _number(row.p_times, ".3g")]


def _number(value: float, how: str = ".1f") -> str:
    return "-" if math.isnan(value) else f"{value:{how}}"


def _time(found: Pairing) -> str:
    if math.isnan(found.time_difference_s):
        return "-"
    bounds = "" if math.isnan(found.time_low) else f" ({found.time_low:+.1f} to {found.time_high:+.1f})"
    return f"{found.time_difference_s:+.1f}{bounds}"
