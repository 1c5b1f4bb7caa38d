"""Laws of rows: what they read they write, whole and typed."""

from __future__ import annotations

import json
import pickle
from typing import Any

import pytest
from bench_runs import clearing_row, error_row, grasp_row, pick_row, stop_row

from mpgrasp.bench.record import Cell, Method, Task, line_of, played, text_of
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.exceptions import ConfigError
from mpgrasp.outcome import Outcome

GRASPED = {"position": [0.5, 0.0, 0.1], "angle": 0.1, "width": 0.04, "quality": None}
ROWS = [
    grasp_row(),
    grasp_row(success=False, outcome="reflex", reflex=stop_row(joint=3), grasp=GRASPED),
    clearing_row(picks=[pick_row(), pick_row(success=False)], stops=[stop_row()], failures={"missed": 1}),
    error_row(),
]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["outcome"])
def test_a_line_comes_back_from_its_text_and_from_another_process(row: dict[str, Any]) -> None:
    line = line_of(row)
    text = text_of(line)
    assert json.loads(text) == row
    assert list(json.loads(text)) == sorted(row)
    assert text.endswith("\n")
    assert line_of(json.loads(text)) == line
    assert pickle.loads(pickle.dumps(line)) == line


def test_what_is_no_number_is_none_in_the_file_and_floats_have_nine_digits() -> None:
    line = line_of(grasp_row(jerk_rms=float("nan"), sim_time_s=1 / 3))
    assert line.as_row()["jerk_rms"] is None
    assert line.as_row()["sim_time_s"] == 0.333333333


@pytest.mark.parametrize("row", [grasp_row(more=1), grasp_row(outcome="well"), error_row(success=False)])
def test_what_is_no_line_is_refused_by_its_key(row: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"more|outcome|success"):
        line_of(row)


def test_a_line_knows_its_task_its_cell_and_its_stops() -> None:
    line = line_of(grasp_row(episode=7, success=False, outcome="reflex", reflex=stop_row()))
    assert line.task == Task("s", 7, "d", "c")
    assert line.task.cell == Cell("s", "d", "c")
    assert line.task.cell.method == Method("d", "c")
    assert (str(line.task.cell), str(line.task.cell.method)) == ("s/d/c", "d/c")
    (alone,) = played([line, line_of(error_row())])
    assert alone.outcome is Outcome.REFLEX
    assert [stop.limit for stop in alone.all_stops] == ["contact_force"]
    (cleared,) = played([line_of(clearing_row(stops=[stop_row(), stop_row(limit="timeout")]))])
    assert [stop.limit for stop in cleared.all_stops] == ["contact_force", "timeout"]


def test_lines_are_put_together_by_cell_in_order_of_first_appearance() -> None:
    lines = [line_of(grasp_row(detector=name, episode=k)) for k, name in enumerate("bab")]
    cells = by_cell(lines)
    assert list(cells) == [Cell("s", "b", "c"), Cell("s", "a", "c")]
    assert [line.episode for line in cells[Cell("s", "b", "c")]] == [0, 2]
