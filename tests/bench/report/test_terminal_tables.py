"""Laws of tables on the terminal: whole where nothing folds them; on a narrow one no word is torn apart."""

from __future__ import annotations

import io

import pytest
from bench_runs import clearing_row, grasp_row
from rich.console import Console

from mpgrasp.bench.analysis.summary import CellSummary, paired_tests, summarise
from mpgrasp.bench.record import line_of
from mpgrasp.bench.report.terminal_tables import PIPED_WIDTH, print_table, print_tests
from mpgrasp.bench.stored_lines import by_cell

SUITES, DETECTORS, CONTROLLERS = (
    ("thin", "find_stick"),
    ("heuristic", "dhrnet"),
    ("mppc_robust", "straight_down"),
)


def rows(suites: tuple[str, ...] = SUITES, episodes: int = 20) -> list[CellSummary]:
    return summarise(
        [
            line_of(
                grasp_row(suite=suite, detector=d, controller=c, episode=k, scene_seed=k, success=k % 3 > 0)
            )
            for suite in suites
            for d in DETECTORS
            for c in CONTROLLERS
            for k in range(episodes)
        ]
    )


def printed(cells: list[CellSummary], width: int, terminal: bool = True) -> str:
    console = Console(file=io.StringIO(), width=width, force_terminal=terminal, color_system=None)
    print_table(cells, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("width", [80, 100, 120, 160])
@pytest.mark.parametrize("suites", [("thin",), SUITES])
def test_no_name_and_no_number_is_torn_apart(width: int, suites: tuple[str, ...]) -> None:
    cells = rows(suites)
    table = printed(cells, width)
    assert max(map(len, table.splitlines())) <= width
    words = table.split()
    for cell in cells:
        bounds = f"{100 * cell.wilson_low:.1f}-{100 * cell.wilson_high:.1f}"
        assert {cell.suite, cell.detector, cell.controller, bounds} <= set(words)
        assert cell.rate is not None
        assert {f"{100 * cell.rate:.1f}", *(f"{o}:{n}" for o, n in cell.failures.items())} <= set(words)
    assert sum(word in CONTROLLERS for word in words) == len(cells)


def test_a_wide_terminal_a_pipe_and_a_file_show_all_columns() -> None:
    for table in (printed(rows(), 160), printed(rows(), 40, terminal=False)):
        assert all(
            heading in table for heading in ("success", "median", "mean time s", "interval", "failures")
        )
    assert PIPED_WIDTH == 160


def test_a_narrower_terminal_shows_fewer_columns_and_never_leaves_out_the_rate() -> None:
    seen = [printed(rows(), width) for width in (160, 90, 70, 30)]
    found = [sum(heading in table for heading in ("success", "median", "mean", "stops")) for table in seen]
    assert found[0] == 4
    assert found[0] > found[1] >= found[2] >= found[3]
    assert all("rate" in table and "interval" in table for table in seen[:3])


def test_columns_of_what_did_not_happen_are_left_out() -> None:
    grasps = [line_of(grasp_row(episode=k)) for k in range(2)]
    assert "errors" not in printed(summarise(grasps), 160)
    assert "picks" not in printed(summarise(grasps), 160)
    assert "picks" in printed(summarise([*grasps, line_of(clearing_row(suite="stacked"))]), 160)


def test_a_table_of_cleared_tables_fits_80_columns_too() -> None:
    lines = [
        line_of(
            clearing_row(
                suite="stacked", detector="dhrnet", controller="mppc_robust", episode=k, scene_seed=k
            )
        )
        for k in range(10)
    ]
    table = printed(summarise(lines), 80)
    assert {"dhrnet", "mppc_robust", "stacked", "picks"} <= set(table.split())
    assert max(map(len, table.splitlines())) <= 80


def test_a_run_without_episodes_says_so() -> None:
    assert printed([], 80).strip() == "No episode was finished."


def test_names_in_paired_tests_are_whole_at_80_columns() -> None:
    lines = [
        line_of(grasp_row(suite="thin", detector=d, controller=c, episode=k, scene_seed=k, success=k % 3 > 0))
        for d in DETECTORS
        for c in CONTROLLERS
        for k in range(4)
    ]
    console = Console(file=io.StringIO(), width=80, force_terminal=True, color_system=None)
    print_tests(paired_tests(by_cell(lines)), console)
    assert isinstance(console.file, io.StringIO)
    words = console.file.getvalue().split()
    assert words.count("straight_down") == words.count("mppc_robust") == 6
