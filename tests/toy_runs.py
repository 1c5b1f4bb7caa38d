"""Made-up runs on disk, with traces, for reports to be drawn from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from bench_runs import clearing_row, configuration_row, error_row, grasp_row, run_row, suite_row

from mpgrasp.bench.playing.trace_recorder import TraceRecorder
from mpgrasp.bench.record import ErrorLine, Line, line_of, text_of
from mpgrasp.recording.recorder import Recorder


def lines(pattern: str, detector: str = "dhrnet", controller: str = "mppc", **other: Any) -> list[Line]:
    """A success for every 1, a failure for every 0, an error row for every x.

    Those with a `time_limit_s` are lines of tables to be cleared.
    """
    found = []
    for episode, letter in enumerate(pattern):
        which = {
            "suite": "thin", "scene_seed": 1000 + episode, "episode": episode,
            "detector": detector, "controller": controller,
        }  # fmt: skip
        if letter == "x":
            known = {key: value for key, value in other.items() if key == "suite"}
            found.append(line_of(error_row(**{**which, "traceback": f"errors/{episode}.txt", **known})))
            continue
        how = {
            "object": "usb_stick",
            "success": letter == "1",
            "sim_time_s": 10.0 + episode / 7,
            "state_hash": f"{detector}{controller}{episode}",
            "min_singular_value": 0.1,
            "blind_drift_m": 0.01,
            "timing": {"render": 4.0, "detect": 2.0, "control": 1.0, "ik": 2.0, "physics": 1.0},
        }
        row = clearing_row if "time_limit_s" in other else grasp_row
        found.append(line_of(row(**{**which, **how, **other})))
    return found


def make_run(folder: Path, episodes: Sequence[Line], **about: Any) -> Path:
    """A folder with run.json and episodes.jsonl; `about` are keys of run.json or of its configuration."""
    folder.mkdir(parents=True)
    grid = {"extent": 0.4, "centre": [0.5, 0.0]}
    changes = {"suite": suite_row("thin"), "controllers": [{"name": "mppc", "config": {"grid": grid}}]}
    changes |= {key: about.pop(key) for key in ("suite", "detectors", "noise") if key in about}
    run = run_row(configuration_row(**changes), **{"command": "python -m mpgrasp.bench thin", **about})
    (folder / "run.json").write_text(json.dumps(run))
    (folder / "episodes.jsonl").write_text("".join(map(text_of, episodes)))
    return folder


CARD = {"physics": {"timestep": 0.002, "geoms": {"pad": {"friction": [0.8]}}}, "motion": {"dt": 0.01}}


EPISODES = [
    *lines("1101x", object="a <b> | `c`"),
    *lines("10001", controller="mvp"),
    *lines("11111", detector="my_net:Net"),
]


MODEL = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><light pos='0 0 2'/><geom type='plane' size='1 1 .1'/>"
    "<body pos='.5 0 .1'><freejoint/><geom type='box' size='.05 .05 .05'/></body></worldbody></mujoco>"
)


class FakeSimulation:
    """A tool and a box that sink; `time` is set from outside."""

    def __init__(self) -> None:
        self.model, self.data, self.time = MODEL, mujoco.MjData(MODEL), 0.0

    @property
    def T_world_tcp(self) -> Any:
        T = np.eye(4)
        T[:3, 3] = 0.5 + self.time / 50, 0.0, 0.5 - self.time / 20
        return T


def trace(folder: Path, line: Line, ticks: int = 30, unmeasured: int = 0) -> None:
    """Keep what a recorder keeps of a made-up episode at 10 Hz; the first ticks have no singular value."""
    assert not isinstance(line, ErrorLine)
    recorder = TraceRecorder(folder, "ray")
    show(recorder, ticks, unmeasured)
    recorder.save(line)


def show(recorder: Recorder, ticks: int = 30, unmeasured: int = 0) -> None:
    """Show a made-up episode to a recorder."""
    simulation = FakeSimulation()
    recorder.start(simulation)  # type: ignore[arg-type]
    for k in range(ticks):
        simulation.time = k / 10
        seen = SimpleNamespace(quality=np.full((20, 20), 0.5, np.float32)) if k < 20 else None
        tick = SimpleNamespace(
            simulation=simulation, phase="reach" if seen else "lift", grasp_map=seen,
            min_singular_value=0.2 - k / 300 if k >= unmeasured else np.nan,
            diagnostics={"entropy": np.full((8, 8), 0.1 * k), "peak": 1.0},
        )  # fmt: skip
        recorder.tick(tick)  # type: ignore[arg-type]
    recorder.finish("over")
