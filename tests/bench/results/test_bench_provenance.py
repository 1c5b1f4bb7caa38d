from __future__ import annotations

import json
import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import fakes
import pytest
from bench_plans import make_plan

from mpgrasp.bench.meshes.check import MeshVerdict
from mpgrasp.bench.playing.description import describe
from mpgrasp.bench.playing.player import Player
from mpgrasp.bench.results.provenance import PACKAGES, provenance

INCONSEQUENTIAL = {
    "gymnasium", "imageio", "jinja2", "lazy-loader", "matplotlib", "msgspec", "pillow", "platformdirs",
    "rerun-sdk", "rich", "safetensors", "threadpoolctl",
}  # fmt: skip
"""Dependencies that draw, store or wrap, and compute nothing of an episode."""


def test_a_run_tells_meshes_by_name_and_hash_and_nobodys_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mpgrasp.bench.playing.world_card.world_card", lambda *_: fakes.WORLD)
    verdict = MeshVerdict(name="mug", path="/home/somebody/meshes/mug.stl", sha256="ab", reason="open")
    plan = make_plan(objects=(verdict,))
    run = describe(plan, Player(plan, fakes.run_episode), ["single", "--objects", "meshes"])
    assert run.as_row()["objects"] == [
        {"name": "mug", "file": "mug.stl", "sha256": "ab", "reason": "open", "grasp_qualities": []}
    ]
    assert "somebody" not in json.dumps(run.as_row())


def test_the_version_of_every_dependency_that_computes_is_recorded_where_it_is_installed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    project = tomllib.loads((Path(__file__).resolve().parents[3] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    needed = {
        re.split(r"[\[>=<]", text)[0]
        for text in [*project["dependencies"], *extras["objects"], *extras["ycb"]]
    } - INCONSEQUENTIAL
    assert needed - {"mpgrasp"} <= set(PACKAGES)
    installed = {"numpy": "1.2.3"}

    def version(name: str) -> str:
        if name not in installed:
            raise metadata.PackageNotFoundError(name)
        return installed[name]

    monkeypatch.setattr(metadata, "version", version)
    assert provenance().packages == installed


def test_the_threads_that_networks_get_are_recorded_without_loading_torch_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(get_num_threads=lambda: 2))
    assert provenance().threads == {"OMP_NUM_THREADS": "3", "torch": 2}
    monkeypatch.delenv("OMP_NUM_THREADS")
    monkeypatch.delitem(sys.modules, "torch")
    assert provenance().threads == {}
    assert "torch" not in sys.modules
