"""`--until-ci`: batches are added until every interval is narrow enough."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from bench_runs import same_results, thin_command

from mpgrasp.anytime import confidence_sequence
from mpgrasp.bench.__main__ import main


def cells_of(out: Path) -> list[dict[str, Any]]:
    cells: list[dict[str, Any]] = json.loads((out / "summary.json").read_text())["cells"]
    return cells


def width(cell: dict[str, Any]) -> float:
    """Width of the confidence sequence of a cell."""
    low, high = confidence_sequence(cell["successes"], cell["n"])
    return high - low


def test_batches_are_added_until_every_interval_is_narrow_enough_and_no_longer(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "until"
    assert main(thin_command(out, "--until-ci", "30", episodes=5)) == 0
    sizes = {cell["n"] for cell in cells_of(out)}
    assert len(sizes) == 1
    (n,) = sizes
    assert n % 5 == 0
    assert all(width(cell) < 0.30 for cell in cells_of(out))
    assert "by an interval that holds at all times at once" in capsys.readouterr().err
    shorter = tmp_path / "shorter"
    assert main(thin_command(shorter, episodes=n - 5)) == 0
    assert any(width(cell) >= 0.30 for cell in cells_of(shorter))


def test_a_cap_ends_what_would_never_be_narrow_enough(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(thin_command(tmp_path, "--until-ci", "1", "--max-episodes", "12", episodes=5)) == 0
    assert {cell["n"] for cell in cells_of(tmp_path)} == {12}
    assert "have not brought every interval of thin below 1 points" in capsys.readouterr().err


def test_until_ci_ends_the_same_after_an_interruption(fake_world: object, tmp_path: Path) -> None:
    whole, out = tmp_path / "whole", tmp_path / "part"
    for folder in (whole, out):
        assert main(thin_command(folder, "--until-ci", "30", episodes=5)) == 0
    lines = (out / "episodes.jsonl").read_text().splitlines(keepends=True)
    (out / "episodes.jsonl").write_text("".join(reversed(lines[7:])))
    assert main(["--resume", str(out)]) == 0
    assert same_results(out, whole)
