"""Published results are complete, of a known commit and from the shipped weights; no more is there."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mpgrasp.bench.analysis.summary import paired_tests, summarise
from mpgrasp.bench.record import Cell, played
from mpgrasp.bench.results.reader import read_lines, read_summary
from mpgrasp.detectors.networks.description import read_card
from mpgrasp.plugin_names import base_name

ROOT = Path(__file__).resolve().parents[3]
RESULTS = ROOT / "benchmarks" / "results"
WEIGHTS = ROOT / "assets" / "weights"
SHIPPED = {path.stem: hashlib.sha256(path.read_bytes()).hexdigest() for path in WEIGHTS.glob("*.safetensors")}
_CARDS = {name: read_card(WEIGHTS / f"{name}.safetensors")["card"] for name in SHIPPED}
EARLIER = {name: card["start"]["sha256"] for name, card in _CARDS.items() if "start" in card}
"""Weights of the first stage of training, that those which ship went on from: results of theirs are stale."""
RUNS = sorted(RESULTS.rglob("run.json"))
EPISODES = {"run.json", "episodes.jsonl", "summary.json", "report.md"}
"""Files of a run of the benchmark."""
STALE: dict[str, str] = {}
"""Runs that no commit tells exactly, with the reason why they are still published."""


def folder_of(path: Path) -> str:
    return path.parent.relative_to(RESULTS).as_posix()


EVERY_RUN = pytest.mark.parametrize("path", RUNS, ids=folder_of)


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


def tracked(pattern: str) -> list[Path]:
    """Files of the repository that match, relative to its root; skips the test outside of a checkout."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("no git checkout")
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--", pattern], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return [Path(name) for name in listed.stdout.split("\0") if name]


def wanted_files(folder: Path) -> set[str]:
    """Names of the files that a published folder consists of."""
    stages = {"training": SHIPPED, "first-stage": EARLIER}
    if folder.name in stages:
        return {f"{network}.{kind}" for network in stages[folder.name] for kind in ("csv", "png")}
    if folder.name == "paper":  # the report on several runs
        return {"report.md"}
    if (ROOT / folder / "episodes.jsonl").exists():
        return EPISODES
    # the same study of earlier weights, of other networks, and with a longer training
    name = re.sub("-(stage1|windows|grconvnet|long)$", "", folder.name)
    return {"run.json", *(f"{name}.{kind}" for kind in ("json", "csv", "png"))}


@EVERY_RUN
def test_a_published_result_is_one_of_the_shipped_weights_or_is_said_to_be_stale(path: Path) -> None:
    everything = list(digests(json.loads(path.read_text(encoding="utf-8"))))
    brought = {name: digest for name, digest in everything if "@" in name}
    for name, digest in brought.items():
        assert digest == EARLIER.get(base_name(name)), f"{name}: weights that nobody can get"
    told = [(name, digest) for name, digest in everything if name not in brought]
    for name, digest in told:
        assert digest in (SHIPPED[name], EARLIER.get(name)), f"{path.parent.name}: other weights of {name}"
    stale = {digest == EARLIER.get(name) for name, digest in told}
    assert len(stale) < 2, "weights of one stage"
    sections = (ROOT / "docs" / "results.md").read_text(encoding="utf-8").split("\n## ")
    own = [section for section in sections if f"`benchmarks/results/{folder_of(path)}`" in section]
    if True in stale:
        assert any("**The networks were trained further since**" in section for section in sections)
    elif told:
        assert any("second stage" in section for section in own), "a section says which weights it is of"
    if brought:
        assert any("first stage" in section for section in own), "and so of those that it brings"


def test_most_published_results_tell_their_weights() -> None:
    told = {name for path in RUNS for name, _ in digests(json.loads(path.read_text(encoding="utf-8")))}
    assert told >= set(SHIPPED)


@pytest.mark.parametrize("path", sorted(RESULTS.glob("**/episodes.jsonl")), ids=folder_of)
def test_the_command_of_a_published_run_makes_the_folder_it_lies_in(path: Path) -> None:
    command = json.loads((path.parent / "run.json").read_text(encoding="utf-8"))["command"].split()
    assert command[:3] == ["python", "-m", "mpgrasp.bench"]
    out = ROOT / command[command.index("--out") + 1]
    assert out == path.parent


@EVERY_RUN
def test_a_published_run_is_of_a_commit_as_it_stands(path: Path) -> None:
    git = json.loads(path.read_text(encoding="utf-8"))["made_with"]["git"]
    assert re.fullmatch(r"[0-9a-f]{40}", git["commit"])
    assert git["modified"] is (folder_of(path) in STALE), "publish runs from a clean checkout"


def test_every_stale_run_is_still_published() -> None:
    assert STALE.keys() <= {folder_of(path) for path in RUNS}


def test_a_published_folder_holds_its_files_and_no_others() -> None:
    found: dict[Path, set[str]] = {}
    for path in tracked("benchmarks/results"):
        found.setdefault(path.parent, set()).add(path.name)
    assert found
    episodes = {
        Path("benchmarks/results/stage2/controller-factors"): {"episodes.csv"}
    }  # a study that goes on from them
    assert found == {folder: wanted_files(folder) | episodes.get(folder, set()) for folder in found}


def test_no_arrays_are_in_the_repository() -> None:
    assert tracked("*.npz") == []


def assert_alike(ours: Any, published: Any, where: str = "") -> None:
    """Raise unless both are the same JSON but for the last bits of floats."""
    if isinstance(ours, dict) and isinstance(published, dict):
        assert list(ours) == list(published), where
        for key, value in ours.items():
            assert_alike(value, published[key], f"{where}.{key}")
    elif isinstance(ours, list) and isinstance(published, list):
        assert len(ours) == len(published), where
        for k, (one, other) in enumerate(zip(ours, published, strict=True)):
            assert_alike(one, other, f"{where}.{k}")
    elif isinstance(ours, float) and published is not None:
        assert published == pytest.approx(ours, rel=1e-6), where
    else:
        assert ours == published, where


@pytest.mark.parametrize("path", sorted(RESULTS.rglob("summary.json")), ids=folder_of)
def test_a_published_summary_follows_from_its_episodes(path: Path) -> None:
    lines = read_lines(path.parent).lines
    summary = json.loads(path.read_text(encoding="utf-8"))
    for key, found in (("cells", summarise(lines)), ("paired_tests", paired_tests(lines))):
        ours = [row.as_row() for row in found]
        for row, published in zip(ours, summary[key], strict=True):
            if "singularities" not in published:  # of before they were counted
                row.pop("singularities", None)
        assert_alike(ours, summary[key], key)
    finished = list(played(lines))
    counts = Counter(line.task.cell for line in finished)
    successes = Counter(line.task.cell for line in finished if line.success)
    worlds = {(line.task.cell, line.scene_seed) for line in finished}
    assert len(worlds) == len(finished)
    cells = {Cell(cell["suite"], cell["detector"], cell["controller"]): cell for cell in summary["cells"]}
    assert {key: cell["n"] for key, cell in cells.items() if cell["n"]} == counts
    assert {key: cell["successes"] for key, cell in cells.items() if cell["successes"]} == successes


@pytest.mark.parametrize("path", sorted(RESULTS.rglob("summary.json")), ids=folder_of)
def test_a_published_summary_is_read_without_losing_or_adding_a_byte(path: Path) -> None:
    summary = read_summary(path.parent)
    assert summary is not None
    assert json.dumps(summary.as_row(), indent=2) + "\n" == path.read_text(encoding="utf-8")
