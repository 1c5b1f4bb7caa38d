"""Laws of the clock that tells where a tick's wall time goes."""

from __future__ import annotations

import pytest

from mpgrasp.episode.stages import STAGES, StageClock


def test_every_stage_has_its_own_median_in_milliseconds() -> None:
    clock = StageClock()
    for seconds in (0.001, 0.050, 0.002):
        clock.add("ik", seconds)
    assert clock.medians() == {stage: 2.0 if stage == "ik" else 0.0 for stage in STAGES}


def test_a_timed_block_counts_to_its_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([10.0, 10.25])
    monkeypatch.setattr("time.perf_counter", lambda: next(now))
    clock = StageClock()
    with clock.timed("detect"):
        pass
    assert clock.medians()["detect"] == 250.0
