from __future__ import annotations

import json
from pathlib import Path

import pytest
from bench_runs import detector_row
from toy_runs import lines, make_run

from mpgrasp.bench.playing.description import suite_card
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.thickness import thin_objects
from mpgrasp.bench.results.runs import find_runs
from mpgrasp.suite import load_suite


def study(folder: Path, sha256: str) -> Path:
    """A published study of `dhrnet` and of another detector."""
    counts = {"count": 1, "rate": 0.5, "wilson_low": 0.1, "wilson_high": 0.9}
    cells = [
        {"detector": name, "thickness_mm": mm, "tcp_height_m": 0.25, "detected": counts}
        for name in ("dhrnet", "tfgrasp") for mm in (2.0, 4.0)
    ]  # fmt: skip
    folder.mkdir()
    about = {
        "command": "python benchmarks/thickness.py",
        "weights_sha256": {"dhrnet": sha256, "tfgrasp": "t"},
    }
    (folder / "run.json").write_text(json.dumps(about))
    (folder / "thickness.json").write_text(json.dumps({"cells": cells}))
    return folder / "thickness.json"


@pytest.mark.parametrize(
    ("name", "sha256", "shown"),
    [("dhrnet", "d", True), ("dhrnet", "retrained", False), ("dhrnet", None, False), ("my:Net", "d", False)],
)
def test_the_published_study_is_shown_of_the_very_weights_that_played(
    tmp_path: Path, name: str, sha256: str | None, shown: bool
) -> None:
    detectors = [detector_row(name, sha256=sha256)]
    runs = find_runs([make_run(tmp_path / "run", lines("1", name), detectors=detectors)])
    found = thin_objects(Evaluation.of(runs), study(tmp_path / "study", "d"))
    if not shown:
        assert found is None
        return
    assert found is not None
    assert found.study_command == "python benchmarks/thickness.py"
    assert "At 2 mm: dhrnet at 0.25 m 50 %." in found.figure.alt
    assert "tfgrasp" not in found.figure.svg


def test_a_study_that_cannot_be_read_is_not_shown(tmp_path: Path) -> None:
    runs = find_runs([make_run(tmp_path / "run", lines("1"), detectors=[detector_row("dhrnet", sha256="d")])])
    file = study(tmp_path / "study", "d")
    file.write_text('{"cells": [{"detector": "dhrnet"}]}')
    assert thin_objects(Evaluation.of(runs), file) is None
    assert thin_objects(Evaluation.of(runs), tmp_path / "absent" / "thickness.json") is None


def test_the_thickness_suites_own_episodes_are_counted_by_thickness(tmp_path: Path) -> None:
    suite = load_suite("thickness")
    episodes = [
        line
        for k, name in enumerate(("stick_2mm", "stick_12mm"))
        for line in lines("0101x111", object=name, suite="thickness")[k::2]
    ]
    runs = find_runs([make_run(tmp_path / "run", episodes, suite=suite_card(suite).as_row())])
    found = thin_objects(Evaluation.of(runs), tmp_path / "no study")
    assert found is not None
    assert found.study_command == ""
    assert found.figure.alt == "Success by the thickness of a stick: DHRNet + MP-PC 2 mm 1/3, 12 mm 4/4."
