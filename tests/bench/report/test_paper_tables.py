"""Laws of the paper's tables: what the paper reports stands beside what was played for it."""

from __future__ import annotations

from pathlib import Path

from toy_runs import lines, make_run

from mpgrasp.bench.report.document import Table
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.paper_tables import success_table
from mpgrasp.bench.results.runs import find_runs

PAPER = {"GG-CNN": 88, "Lenz et al.": 76, "Pinto et al.": 64, "TF-Grasp": 87, "DHRNet": 91}
"""Table III, of 100 grasps each."""


def table_iii(folder: Path, *detectors: str) -> Table:
    played = [line for name in detectors for line in lines("1101", suite="single", detector=name)]
    return success_table(Evaluation.of(find_runs([make_run(folder, played)])), "single")


def test_all_five_methods_of_table_iii_stand_in_it_as_the_paper_has_them(tmp_path: Path) -> None:
    rows = {row[0]: row[1] for row in table_iii(tmp_path / "run", "oracle").rows}
    for name, lifted in PAPER.items():
        assert rows[f"{name} + MP-PC"].startswith(f"{lifted}/100 = {lifted}.0 %")


def test_each_of_them_can_be_played_here(tmp_path: Path) -> None:
    names = ("ggcnn", "lenz", "pinto", "tfgrasp", "dhrnet")
    rows = {row[0]: row[2] for row in table_iii(tmp_path / "run", *names).rows}
    assert set(rows) == {f"{name} + MP-PC" for name in PAPER}
    assert all(here.startswith("3/4 = 75.0 %") for here in rows.values())


def test_what_was_not_played_is_said_to_be_so(tmp_path: Path) -> None:
    rows = {row[0]: row[2] for row in table_iii(tmp_path / "run", "dhrnet", "lenz").rows}
    assert rows["Pinto et al. + MP-PC"] == "not run"
    assert rows["Lenz et al. + MP-PC"] != "not run"
