"""Runs of the benchmark with stand-ins, and what they leave."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

PLUG_INS = ["--detector", "fakes:FakeDetector", "--controller", "fakes:FakeController", "--workers", "0"]


def records(out: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (out / "episodes.jsonl").read_text().splitlines()]
