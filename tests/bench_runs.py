"""Runs of the benchmark with stand-ins, the files that they leave, and made-up rows of such files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

PLUG_INS = ["--detector", "fakes:FakeDetector", "--controller", "fakes:FakeController", "--workers", "0"]

TWO_CONTROLLERS = [*PLUG_INS[:3], "fakes:FakeController,fakes:OtherController", *PLUG_INS[4:]]

Row = dict[str, Any]
"""Plain values of a row: what `mpgrasp.bench.record.line_of` makes a line of."""


def records(out: Path) -> list[Row]:
    return [json.loads(line) for line in (out / "episodes.jsonl").read_text().splitlines()]


def thin_command(out: Path, *more: str, episodes: int = 6) -> list[str]:
    return ["thin", *TWO_CONTROLLERS, "--quiet", "--episodes", str(episodes), "--out", str(out), *more]


def records_without_timing(out: Path) -> list[Row]:
    return [{key: item for key, item in line.items() if key != "timing"} for line in records(out)]


def same_results(a: Path, b: Path) -> bool:
    summaries = [(out / "summary.json").read_bytes() for out in (a, b)]
    return summaries[0] == summaries[1] and records_without_timing(a) == records_without_timing(b)


def grasp_row(**changes: Any) -> Row:
    """A line of a grasp that succeeded; `outcome` follows from `success` unless it is given."""
    row = {
        "suite": "s", "seed": 0, "scene_seed": 1, "episode": 0, "detector": "d", "controller": "c",
        "object": "key", "success": True, "sim_time_s": 5.0, "ticks": 50, "reflex": None, "grasp": None,
        "min_singular_value": None, "near_singularity_s": None, "path_length_m": None, "jerk_rms": None,
        "spectral_arc_length": None, "first_detection_s": None, "blind_drift_m": None,
        "timing": {"detect": 1.0}, "state_hash": "0", **changes,
    }  # fmt: skip
    return {"outcome": "success" if row["success"] else "missed", **row}


def pick_row(**changes: Any) -> Row:
    """An attempt of a clearing that succeeded."""
    row = grasp_row(start_s=0.0, end_s=20.0, **changes)
    of_episode = ("suite", "seed", "scene_seed", "episode", "detector", "controller", "timing", "state_hash")
    return {key: value for key, value in row.items() if key not in of_episode}


def clearing_row(**changes: Any) -> Row:
    """A line of a table that was cleared without an attempt."""
    of_clearing = {
        "object": "0 objects", "failures": {}, "in_basket": [], "knocked_off": [], "left": [], "stops": [],
        "time_limit_s": 900.0, "picks": [],
    }  # fmt: skip
    return grasp_row(**{**of_clearing, **changes})


def error_row(**changes: Any) -> Row:
    """A line of an episode that could not be played."""
    row = {
        "suite": "s", "seed": 0, "scene_seed": 1, "episode": 0, "detector": "d", "controller": "c",
        "outcome": "error", "success": None, "error": "a bug", "traceback": "errors/it.txt",
    }  # fmt: skip
    return {**row, **changes}


def stop_row(**changes: Any) -> Row:
    """A protective stop."""
    row = {"limit": "contact_force", "joint": None, "value": 60.0, "bound": 50.0, "time": 3.0}
    return {**row, "demanded": False, "text": "contact force of 60 N, limit 50 N", **changes}


def suite_row(name: str = "s", **changes: Any) -> Row:
    """A suite as run.json declares it."""
    return {
        "name": name,
        "title": "T",
        "scenes": [],
        "trial": "grasp",
        "trials": 10,
        "episode": {},
        **changes,
    }


def configuration_row(**changes: Any) -> Row:
    """`configuration` of a run.json: of one suite, unless `suites` are among the changes."""
    alone = {} if "suites" in changes else {"suite": suite_row(), "episode": {}, "episodes": 10}
    row = {
        "cells": ["d/c"], "detectors": [detector_row()], "controllers": [{"name": "c", "config": None}],
        "until_ci": None, "max_episodes": None, "seed": 0, "camera": "auto", "noise": True,
    }  # fmt: skip
    return {**alone, **row, **changes}


def detector_row(name: str = "d", **changes: Any) -> Row:
    """A detector as run.json declares it."""
    row = {"name": name, "weights": None, "sha256": None, "reads_truth": False}
    return {**row, "device": None, "runtime": None, "config": None, **changes}


def made_with_row(**changes: Any) -> Row:
    """`made_with` of a run.json."""
    row = {"mpgrasp": "0.1.0", "git": None, "python": "3.11.7", "platform": "Linux", "machine": "x86_64"}
    return {**row, "packages": {}, "threads": {}, **changes}


def run_row(configuration: Row | None = None, **changes: Any) -> Row:
    """Content of a run.json."""
    row = {
        "format": 1, "command": "python -m mpgrasp.bench s", "started": "2026-01-01T12:00:00+00:00",
        "configuration": configuration or configuration_row(), "physics": {}, "camera": {}, "motion": {},
        "ik": {}, "reflex": {}, "made_with": made_with_row(),
    }  # fmt: skip
    return {**row, **changes}
