"""The end of a run: its lines in order, summary, report and table."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from mpgrasp.bench.analysis.ladder import climbs
from mpgrasp.bench.analysis.race import state_of
from mpgrasp.bench.analysis.summary import RunSummary, paired_tests, summarise
from mpgrasp.bench.record import Line
from mpgrasp.bench.report.ladder import threshold_table
from mpgrasp.bench.report.sweep import sweep_table
from mpgrasp.bench.report.terminal_tables import print_report_table, print_table, print_tests
from mpgrasp.bench.results.run_card import Configuration
from mpgrasp.bench.results.trace import prune_traces
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.command_line import EXIT_BAD_INPUT, print_error
from mpgrasp.exceptions import OutputError

EXIT_BROKEN = 1
"""Exit code where some episodes could not be played."""


def conclude(
    directory: RunDirectory,
    lines: Sequence[Line],
    configuration: Configuration,
    *,
    finished: bool,
    report: bool = True,
) -> int:
    """Put the lines into their folder, write and print what they add up to.

    Args:
        directory: of the run; it is closed.
        lines: one of each episode, in the order of the plan.
        configuration: of the run.
        finished: True if no episode is missing.
        report: write report.html and report.md too.

    Returns:
        The exit code that follows from it.
    """
    if report:
        from mpgrasp.bench.report.build import write_report

    code = 0
    by_cells = by_cell(lines)
    cells, tests = summarise(by_cells), paired_tests(by_cells)
    errors = sum(cell.errors for cell in cells)
    try:
        directory.settle(lines)
        directory.write_summary(
            RunSummary(complete=finished and not errors, cells=tuple(cells), paired_tests=tuple(tests))
        )
        prune_traces(directory.path / "traces")
        if report:
            write_report([directory.path], directory.path)
    except OutputError as error:
        print_error(error)
        code = EXIT_BAD_INPUT
    finally:
        directory.close()
    if configuration.ladder and cells:
        print_report_table(threshold_table(configuration.ladder, climbs(configuration.ladder, by_cells)))
    else:
        print_table(cells)
        print_tests(tests)
    if configuration.sweep and cells:
        print_report_table(sweep_table(configuration.sweep, by_cells))
    if configuration.race and cells:
        print(state_of(configuration.race, cells[0].cell.suite, by_cells))
    print(f"Results: {directory.path}")
    if errors:
        print(
            f"mpgrasp: {errors} episodes could not be played, see {directory.path / 'errors'}; "
            f"--resume {directory.path} tries them again",
            file=sys.stderr,
        )
        code = code or EXIT_BROKEN
    return code
