"""Files of published runs load into typed rows, and come back byte for byte."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mpgrasp.bench.record import line_of, text_of
from mpgrasp.bench.results.reader import read_lines, read_run, read_summary

RESULTS = Path(__file__).resolve().parents[3] / "benchmarks" / "results"
PLAYED = sorted(path.parent for path in RESULTS.glob("**/episodes.jsonl"))
EVERY_RUN = pytest.mark.parametrize("folder", PLAYED, ids=lambda folder: folder.name)


def test_there_are_published_runs() -> None:
    assert len(PLAYED) >= 7


@EVERY_RUN
def test_every_published_line_is_a_typed_line_of_the_same_bytes(folder: Path) -> None:
    texts = (folder / "episodes.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    assert texts
    assert [text_of(line_of(json.loads(text))) for text in texts] == texts
    assert len(read_lines(folder).lines) == len(texts)


@EVERY_RUN
def test_every_published_run_json_is_a_typed_description_of_the_same_bytes(folder: Path) -> None:
    text = (folder / "run.json").read_text(encoding="utf-8")
    assert json.dumps(read_run(folder).as_row(), indent=2) + "\n" == text


@EVERY_RUN
def test_every_published_summary_is_typed_rows_of_the_same_bytes(folder: Path) -> None:
    text = (folder / "summary.json").read_text(encoding="utf-8")
    summary = read_summary(folder)
    assert summary is not None
    assert json.dumps(summary.as_row(), indent=2) + "\n" == text
