"""What benchmarks/results/ publishes must come from what ships."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
RESULTS = ROOT / "benchmarks" / "results"
SHIPPED = {
    path.stem: hashlib.sha256(path.read_bytes()).hexdigest()
    for path in (ROOT / "assets" / "weights").glob("*.safetensors")
}


def digests(value: Any) -> Iterator[tuple[str, str]]:
    """(detector, SHA-256 of its weights) wherever a run.json tells them."""
    if isinstance(value, dict):
        if isinstance(value.get("name"), str) and isinstance(value.get("sha256"), str):
            yield value["name"], value["sha256"]
        for key, item in value.items():
            if key == "weights_sha256":  # of a study, by detector; None where a network was not trained
                yield from ((name, digest) for name, digest in item.items() if digest is not None)
            elif key != "objects":  # meshes have a name and a digest too
                yield from digests(item)
    elif isinstance(value, list):
        for item in value:
            yield from digests(item)


RUNS = sorted(RESULTS.rglob("run.json"))


@pytest.mark.parametrize("path", RUNS, ids=lambda path: path.parent.name)
def test_a_published_result_is_one_of_the_shipped_weights(path: Path) -> None:
    for name, digest in digests(json.loads(path.read_text(encoding="utf-8"))):
        assert digest == SHIPPED[name], f"{path.parent.name} was made with other weights of {name}"


def test_most_published_results_tell_their_weights() -> None:
    told = {name for path in RUNS for name, _ in digests(json.loads(path.read_text(encoding="utf-8")))}
    assert told >= set(SHIPPED)


@pytest.mark.parametrize("path", sorted(RESULTS.glob("**/episodes.jsonl")), ids=lambda p: p.parent.name)
def test_the_command_of_a_published_run_makes_the_folder_it_lies_in(path: Path) -> None:
    command = json.loads((path.parent / "run.json").read_text(encoding="utf-8"))["command"].split()
    out = ROOT / command[command.index("--out") + 1]
    assert out == path.parent
