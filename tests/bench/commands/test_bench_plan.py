"""Laws of `bench plan`: the time of a run before it is played, and nothing is left behind."""

from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.commands.plan import duration, make_parser

OPTIONS = ["thin", "--detector", "oracle", "--controller", "open_loop", "--camera", "ray", "--workers", "0"]


def test_a_run_takes_as_long_as_its_plan_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", *OPTIONS, "--episodes", "12"]) == 0
    out = capsys.readouterr().out
    assert not [*tmp_path.iterdir()]
    assert max(map(len, out.splitlines())) <= 80
    said = float(re.findall(r"1, here\D+(\d+) s", out)[0])
    clock = time.monotonic()
    assert main([*OPTIONS, "--episodes", "12", "--quiet", "--out", "run"]) == 0
    took = time.monotonic() - clock
    # reading the suite and drawing the report is not in the plan, and other programs are at work beside tests
    assert 0.4 * took - 1.0 <= said <= 2.0 * took + 1.0


def test_a_sweep_has_a_plan_too(capsys: pytest.CaptureFixture[str]) -> None:
    grid = ["--set", "execution.lift=0.1,0.2"]
    assert main(["plan", "sweep", *OPTIONS, *grid, "--episodes", "5", "--on", "3", "--seconds", "0"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"thin\D+10\D+1\D", out), "10 episodes, of which one was played"
    assert re.search(r"│\s+3 │", out)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "the following arguments are required: SUITE"),
        ([*OPTIONS, "--out", "x"], "plan with --out"),
        (["--resume", "x"], "plan with --resume"),
        ([*OPTIONS, "--on", "0"], "unusable number; got '0'; allowed: 1 to 100000"),
        ([*OPTIONS, "--on", ""], "unusable number; got ''"),
        ([*OPTIONS, "--seconds", "-1"], "unusable number; got '-1'"),
        (["thick"], "unknown suite; got 'thick'"),
    ],
)
def test_what_cannot_be_planned_is_refused_in_a_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", *words]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.4, "0 s"),
        (119.0, "119 s"),
        (120.0, "2 min"),
        (7199, "120 min"),
        (7200, "2 h"),
        (200000, "2.31 days"),
    ],
)
def test_a_time_is_told_in_a_unit_that_gives_it_a_number_of_two(seconds: float, said: str) -> None:
    assert duration(seconds) == said


def test_its_help_has_both_kinds_of_workers() -> None:
    text = make_parser().format_help()
    assert "--on K[,K]" in text
    assert "--workers K" in text
