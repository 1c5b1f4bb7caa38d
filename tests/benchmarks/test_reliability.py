"""Laws of the study of reliability: what counts as a fault, and its quick part, played for real."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import killed_runs
import pytest
import reliability
from bench_runs import error_row, grasp_row
from refusals import Ended, Trial, ended_by_errors, found_out, play, run, trials
from small_disks import holds_the_same
from toy_recordings import play as play_toy
from toy_recordings import toy_simulation
from whole_runs import different, fault_at_end

from mpgrasp.recording.rerun import RerunRecorder

WELL = "import sys; print('mpgrasp: error: no such thing', file=sys.stderr); sys.exit(2)"


def verdict(code: str, tmp_path: Path, **changes: Any) -> str:
    """What is said of a process that runs a line of Python."""

    def set_up(folder: Path) -> Sequence[str]:
        (folder / "thesis.tex").write_text("not to be lost")
        return [sys.executable, "-c", code]

    trial = Trial(**{"kind": "k", "name": "n", "set_up": set_up, "said": "no such thing", **changes})
    row = play(trial, tmp_path / "cache")
    assert (row["kind"], row["name"]) == ("k", "n")
    return str(row["fault"])


def test_one_line_and_exit_code_2_is_as_it_must_be(tmp_path: Path) -> None:
    assert verdict(WELL, tmp_path) == ""


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        ("import time; time.sleep(60)", "still at work after 0.5 s"),
        ("1 / 0", "a traceback"),
        (WELL.replace("exit(2)", "exit(1)"), "exit code 1 in place of 2: mpgrasp: error"),
        (WELL.replace("exit(2)", "exit(0)"), "exit code 0 in place of 2"),
        (WELL.replace("thing'", "thing\\nat all'"), "2 lines on stderr"),
        (f"print('so'); {WELL}", "1 lines on stderr and 3 characters on stdout"),
        (WELL.replace("such", "other"), "not said: no such thing"),
        (f"open('new', 'w').write('x'); {WELL}", "left behind: .*new"),
        (f"import os; os.remove('thesis.tex'); {WELL}", "left behind: .*thesis.tex"),
        (f"open('thesis.tex', 'w').close(); {WELL}", "left behind: .*thesis.tex"),
    ],
)
def test_anything_else_is_a_fault(code: str, fault: str, tmp_path: Path) -> None:
    limit = 0.5 if "sleep" in code else 60.0
    assert re.search(fault, verdict(code, tmp_path, limit=limit))


def test_what_a_process_has_started_ends_with_it(tmp_path: Path) -> None:
    child = "import os, time; open('pid', 'w').write(str(os.getpid())); time.sleep(60)"
    code = (
        f"import subprocess, sys, time; subprocess.Popen([sys.executable, '-c', {child!r}]); time.sleep(60)"
    )
    ended = run([sys.executable, "-c", code], tmp_path, {}, 2.0)
    assert ended.code is None
    pid = int((tmp_path / "pid").read_text())
    deadline = time.monotonic() + 10
    while Path(f"/proc/{pid}").exists() and "Z" not in Path(f"/proc/{pid}/stat").read_text().split()[2]:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_plug_in_counts_as_ended_by_errors_if_the_run_has_three_rows_of_them(tmp_path: Path) -> None:
    ended = Ended(code=1, out="", err="", seconds=1.0)
    (tmp_path / "run").mkdir()

    def left(*rows: dict[str, Any]) -> str:
        (tmp_path / "run" / "episodes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
        return ended_by_errors(tmp_path, ended)

    assert left(*(error_row(episode=k) for k in range(3))) == ""
    assert (
        left(error_row(episode=0), error_row(episode=1), grasp_row(episode=2))
        == "2 error rows of 3 in place of 3"
    )
    assert left() == "0 error rows of 0 in place of 3"


def test_the_kit_has_found_it_out_if_a_broken_finding_says_so() -> None:
    findings = [
        {"check": "units", "must": True, "state": "failed", "reason": "in millimetres"},
        {"check": "speed", "must": False, "state": "passed", "reason": "in time"},
    ]
    ended = Ended(code=1, out=json.dumps({"findings": findings}), err="", seconds=1.0)
    assert found_out("units: in milli")(Path(), ended) == ""
    assert "not said: speed" in found_out("speed: in time")(Path(), ended)


def test_runs_are_different_where_a_line_differs_in_more_than_its_timing(tmp_path: Path) -> None:
    for name, rows in {
        "a": [grasp_row(episode=0, timing={"detect": 1.0}), grasp_row(episode=1)],
        "b": [grasp_row(episode=1), grasp_row(episode=0, timing={"detect": 9.0})],
        "c": [grasp_row(episode=0), grasp_row(episode=1, state_hash="other")],
    }.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "episodes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert different(tmp_path / "a", tmp_path / "b") == ""
    assert different(tmp_path / "a", tmp_path / "c") == "1 of 2 lines differ"


@pytest.mark.parametrize(
    ("code", "err", "fault"),
    [
        (0, "", ""),
        (None, "", "still at work after 3 s"),
        (1, "no", "exit code 1: no"),
        (0, "Traceback (most recent call last):", "a traceback"),
    ],
)
def test_a_run_ends_well_with_0_and_no_traceback(code: int | None, err: str, fault: str) -> None:
    assert fault_at_end(Ended(code=code, out="", err=err, seconds=3.0)) == fault


def test_a_worker_that_outlives_its_parent_is_noticed_and_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(killed_runs, "ORPHANS", 0.3)
    child = "import subprocess, sys; subprocess.Popen(['sleep', '60']); sys.exit()"
    process = subprocess.Popen([sys.executable, "-c", child], start_new_session=True)
    process.wait()
    assert "still at work" in killed_runs._left_alive(process.pid)
    monkeypatch.setattr(killed_runs, "ORPHANS", 10.0)
    assert killed_runs._left_alive(process.pid) == ""


def test_only_whole_lines_count_as_written(tmp_path: Path) -> None:
    assert killed_runs._whole_lines(tmp_path) == []
    (tmp_path / "episodes.jsonl").write_bytes(b'{"a": 1}\n{"b": 2}\n{"c')
    assert killed_runs._whole_lines(tmp_path) == [b'{"a": 1}', b'{"b": 2}']


def test_shares_are_of_trials_without_a_fault_and_the_slowest_is_told() -> None:
    rows = [
        {"kind": kind, "name": "n", "fault": fault, "seconds": seconds}
        for kind, fault, seconds in [("a", "", 1.0), ("a", "a traceback", 2.0), ("b", "", 4.0)]
    ]
    found = reliability.by_kind(rows)
    told = {kind: (some["count"], some["n"], some["slowest_s"]) for kind, some in found.items()}
    assert told == {"a": (1, 2, 2.0), "b": (1, 1, 4.0), "all": (2, 3, 4.0)}


def test_the_whole_set_is_as_large_as_it_is_said_to_be() -> None:
    kinds = [trial.kind for trial in trials()]
    count = {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}
    assert count["mesh"] >= 75
    assert count["weights"] >= 40
    assert count["command"] >= 150
    assert sum(n for kind, n in count.items() if kind.startswith("plug-in")) >= 35
    assert len({(trial.kind, trial.name) for trial in trials()}) == len(kinds)


def test_the_quick_part_has_no_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--sample", "1", "--kills", "2", "--episodes", "1", "--seed", "3", "--out", str(tmp_path)]
    assert reliability.main(words) == 0
    results = json.loads((tmp_path / "reliability.json").read_text())
    assert results["faults"] == []
    assert set(results["kinds"]) | set(results["not_played"]) == {
        "mesh", "weights", "command", "plug-in, found out by guard", "plug-in, found out by loader",
        "plug-in, found out by kit", "equal runs", "SIGKILL", "full disk", "all",
    }  # fmt: skip
    assert results["kinds"]["SIGKILL"]["n"] == 2
    assert "Results: " in capsys.readouterr().out
    assert not (tmp_path / "parts").exists()


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_recordings_hold_the_same_if_their_rows_are_and_a_cut_one_does_not(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    paths = [tmp_path / f"{name}.rrd" for name in "abc"]
    for path in paths:
        play_toy(RerunRecorder(path), toy_simulation())
    paths[2].write_bytes(paths[2].read_bytes()[: paths[2].stat().st_size // 2])
    assert holds_the_same(paths[0], paths[1])
    assert not holds_the_same(paths[2], paths[0])
