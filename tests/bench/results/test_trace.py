from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as changed
from toy_runs import lines, trace

from mpgrasp.bench.record import played
from mpgrasp.bench.results.trace import KEPT, prune_traces, read_trace
from mpgrasp.exceptions import OutputError
from mpgrasp.outcome import Outcome


def test_a_trace_is_read_as_it_was_recorded(tmp_path: Path) -> None:
    (line,) = played(lines("0"))
    trace(tmp_path, line)
    found = read_trace(tmp_path, line)
    assert found is not None
    np.testing.assert_allclose(found.times, np.arange(30) / 10, atol=1e-6)
    np.testing.assert_allclose(found.positions[-1], [0.558, 0.0, 0.355], atol=1e-6)
    assert found.singular_values[0] == pytest.approx(0.2)
    assert found.entropy is not None
    assert found.entropy[0, 0] == pytest.approx(2.9, abs=1e-2)
    assert len(found.stills) == len(found.still_times) == 6
    assert found.still_phases[0] == "reach"
    assert found.still_phases[-1] == "lift"
    assert all(still[:4] == b"RIFF" for still in found.stills)
    assert read_trace(tmp_path, changed(line, success=True, outcome=Outcome.SUCCESS)) is None
    assert read_trace(tmp_path, changed(line, state_hash="x")) is None


def test_the_same_traces_are_kept_in_whatever_order_episodes_end(tmp_path: Path) -> None:
    episodes = lines("0" * KEPT + "0110")
    orders = (range(len(episodes)), reversed(range(len(episodes))))
    for folder, order in zip((tmp_path / "a", tmp_path / "b"), orders, strict=True):
        for k in order:
            trace(folder, episodes[k], ticks=3)
        prune_traces(folder)
    kept = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    assert kept.keys() == {path.name for path in (tmp_path / "b").iterdir()}
    name = "thin-dhrnet-mppc-{:04d}-{}.npz"
    ways = {name.format(k, "failure") for k in range(KEPT)} | {name.format(KEPT + 1, "success")}
    stills = {name.format(0, "failure-stills"), name.format(KEPT + 1, "success-stills")}
    assert kept.keys() == ways | stills


def test_an_episode_that_ends_otherwise_replaces_its_trace(tmp_path: Path) -> None:
    (line,) = played(lines("0"))
    trace(tmp_path, line, ticks=3)
    trace(tmp_path, changed(line, success=True, outcome=Outcome.SUCCESS), ticks=3)
    assert {path.name.rpartition("-0000-")[2] for path in tmp_path.iterdir()} == {
        "success.npz", "success-stills.npz",
    }  # fmt: skip


def test_a_long_episode_is_thinned_out_evenly(tmp_path: Path) -> None:
    (line,) = played(lines("1"))
    trace(tmp_path, line, ticks=9000)
    found = read_trace(tmp_path, line)
    assert found is not None
    assert len(found.times) <= 4001
    assert np.ptp(np.diff(found.times)) < 1e-3
    assert found.still_times[0] == 0.0
    assert found.still_times[-1] == pytest.approx(899.9, abs=30)


def test_traces_that_cannot_be_written_are_an_output_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="a trace cannot be written"):
        trace(tmp_path / "file" / "traces", lines("1")[0], ticks=2)
