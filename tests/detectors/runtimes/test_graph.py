"""Laws of graphs: with one, a weights file gives the bits that it gives through torch, and needs none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file
from toy_networks import SMALL, frame, random_weights

from mpgrasp.detectors.__main__ import main
from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.networks.description import read_header
from mpgrasp.detectors.networks.registry import default_weights
from mpgrasp.detectors.networks.weights import NetworkWeights, load_weights, save_weights
from mpgrasp.detectors.runtimes import graph as graphs
from mpgrasp.detectors.runtimes.compiled import find, of_graph
from mpgrasp.detectors.runtimes.graph import digests, find_graph, read_graph
from mpgrasp.detectors.runtimes.openvino import OpenVinoRuntime, openvino_precision
from mpgrasp.detectors.runtimes.torch_runtime import TorchRuntime
from mpgrasp.exceptions import WeightsError

pytestmark = pytest.mark.skipif(openvino_precision() is None, reason="no OpenVINO for this processor")

SHIPPED = ("dhrnet", "tfgrasp", "ggcnn", "ggcnn2", "grconvnet", "lenz", "pinto")
TRANSFORMER = {"embed": 16, "depths": (1, 1, 1, 1), "heads": (1, 1, 1, 1)}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return saved(tmp_path / "mine.safetensors", "dhrnet", SMALL)


def saved(file: Path, name: str, settings: dict[str, Any]) -> Path:
    torch.manual_seed(0)
    weights = random_weights(name, settings)
    for layer in weights.network.modules():  # fresh batch norms do next to nothing
        if isinstance(layer, torch.nn.BatchNorm2d):
            assert layer.running_mean is not None
            assert layer.running_var is not None
            layer.running_mean.normal_(0, 0.1)
            layer.running_var.uniform_(0.5, 2)
    save_weights(file, weights)
    return file


def make(name: str, file: Path) -> Path:
    assert main(["graph", name, "--weights", str(file)]) == 0
    return file.with_suffix(".graph")


def image(weights: NetworkWeights) -> np.ndarray[Any, np.dtype[np.float32]]:
    shape = weights.input.channels, weights.input.size, weights.input.size
    return np.random.default_rng(1).normal(0, 0.3, shape).astype(np.float32)


@pytest.mark.parametrize("precision", ["f32", "bf16"])
@pytest.mark.parametrize(
    ("name", "settings"),
    [("dhrnet", SMALL), ("tfgrasp", TRANSFORMER), ("ggcnn2", {}), ("unet", {}), ("lenz", {}), ("pinto", {})],
)
def test_a_graph_gives_the_bits_of_the_network_as_torch_traces_it(
    name: str, settings: dict[str, Any], precision: str, tmp_path: Path
) -> None:
    file = saved(tmp_path / "mine.safetensors", name, settings)
    graph = read_graph(make(name, file))
    assert graph is not None
    weights = load_weights(name, file)
    tensors = graphs.read_tensors(graph, file.read_bytes(), file)
    assert tensors is not None
    heads = OpenVinoRuntime.of_graph(graph, tensors, precision)(image(weights))
    assert np.array_equal(heads, OpenVinoRuntime(weights, precision)(image(weights)))
    assert np.ptp(heads) > 0


@pytest.mark.parametrize("name", SHIPPED)
def test_the_shipped_graphs_are_those_of_the_shipped_networks(name: str) -> None:
    file = default_weights(name)
    graph = find_graph(read_header(file), file)
    assert graph is not None, f"make it again: python -m mpgrasp.detectors graph {name}"
    tensors = graphs.read_tensors(graph, file.read_bytes(), file)
    assert tensors is not None
    weights = load_weights(name)
    expected = TorchRuntime(weights, plain=True)(image(weights))
    found = OpenVinoRuntime.of_graph(graph, tensors, "f32")(image(weights))
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


def test_the_same_network_has_the_same_graph(file: Path) -> None:
    first = make("dhrnet", file).read_bytes()
    assert make("dhrnet", file).read_bytes() == first
    assert len(first) < 100_000  # it holds no weights


def test_other_weights_of_the_same_settings_share_a_graph(file: Path, tmp_path: Path) -> None:
    graph = make("dhrnet", file)
    torch.manual_seed(1)
    other = tmp_path / "other.safetensors"
    save_weights(other, random_weights("dhrnet", SMALL))
    assert of_graph("dhrnet", other) is None  # the shipped one is for another width
    graph.rename(other.with_suffix(".graph"))
    assert of_graph("dhrnet", other) is not None
    assert of_graph("dhrnet", file) is None


def test_a_network_of_a_graph_is_found_compiled_the_next_time(file: Path) -> None:
    make("dhrnet", file)
    first = NetworkDetector.load("dhrnet", file, runtime="openvino")
    maps = first.predict(frame())
    assert "(cached)" not in first.readiness
    assert find("dhrnet", file) is not None
    second = NetworkDetector.load("dhrnet", file, runtime="openvino")
    for array in ("quality", "angle", "width"):
        assert np.array_equal(getattr(second.predict(frame()), array), getattr(maps, array))
    assert second.readiness.endswith("(cached)")


def test_a_graph_is_not_believed_once_the_code_of_its_network_has_changed(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = read_graph(make("dhrnet", file))
    assert graph is not None
    assert set(graph.facts.sources) == {"dhrnet.py", "grasp_network.py"}
    changed = tmp_path / "networks"
    changed.mkdir()
    for name in graph.facts.sources:
        (changed / name).write_bytes((graphs.NETWORK_SOURCES / name).read_bytes())
    monkeypatch.setattr(graphs, "NETWORK_SOURCES", changed)
    assert digests(graph.facts.sources) == graph.facts.sources
    assert of_graph("dhrnet", file) is not None
    (changed / "dhrnet.py").write_text("# another network\n")
    assert of_graph("dhrnet", file) is None
    (changed / "dhrnet.py").unlink()
    assert of_graph("dhrnet", file) is None


@pytest.mark.parametrize("spoil", ["cut", "junk", "no facts", "other format"])
def test_a_damaged_graph_is_no_graph(spoil: str, file: Path) -> None:
    graph = make("dhrnet", file)
    whole = graph.read_bytes()
    with zipfile.ZipFile(graph) as parts:
        inside = {name: parts.read(name) for name in parts.namelist()}
    facts = json.loads(inside["facts.json"])
    if spoil == "cut":
        graph.write_bytes(whole[: len(whole) // 2])
    elif spoil == "junk":
        graph.write_bytes(b"graph")
    else:
        inside["facts.json"] = b"{}" if spoil == "no facts" else json.dumps({**facts, "format": "2"}).encode()
        with zipfile.ZipFile(graph, "w") as parts:
            for name, content in inside.items():
                parts.writestr(name, content)
    assert of_graph("dhrnet", file) is None
    assert NetworkDetector.load("dhrnet", file).predict(frame()).quality.any()  # torch reads it


def test_a_graph_of_layers_that_openvino_does_not_know_is_left_to_torch(file: Path) -> None:
    graph = read_graph(make("dhrnet", file))
    assert graph is not None
    later = graphs.Graph(
        facts=graph.facts, layers=graph.layers.replace(b'type="Relu"', b'type="Relu99"'), constants=b""
    )
    graphs.write_graph(file.with_suffix(".graph"), later)
    assert of_graph("dhrnet", file) is None


@pytest.mark.parametrize("spoil", ["missing", "NaN", "shape", "network"])
def test_weights_that_do_not_fit_are_refused_in_the_words_of_torch(spoil: str, tmp_path: Path) -> None:
    with_graph = tmp_path / "w.safetensors"
    state = load_file(default_weights("ggcnn2"))
    metadata = _metadata(default_weights("ggcnn2"))
    key = sorted(state)[0]
    if spoil == "missing":
        del state[key]
    elif spoil == "NaN":
        state[key] = state[key] * torch.nan
    elif spoil == "shape":
        state[key] = state[key][..., :-1].contiguous()
    save_file(state, with_graph, metadata=metadata)
    name = "ggcnn" if spoil == "network" else "ggcnn2"
    with pytest.raises(WeightsError) as torchs:
        load_weights(name, with_graph)
    with pytest.raises(WeightsError) as ours:
        of_graph(name, with_graph)
    assert str(ours.value) == str(torchs.value)


def test_weights_in_bfloat16_are_left_to_torch(tmp_path: Path) -> None:
    state = {
        k: v.bfloat16() if v.is_floating_point() else v
        for k, v in load_file(default_weights("ggcnn2")).items()
    }
    save_file(state, tmp_path / "half.safetensors", metadata=_metadata(default_weights("ggcnn2")))
    assert of_graph("ggcnn2", tmp_path / "half.safetensors") is None
    assert NetworkDetector.load("ggcnn2", tmp_path / "half.safetensors").predict(frame()).quality.any()


def test_an_episode_without_torch_is_the_one_with_it(tmp_path: Path) -> None:
    rows = []
    for with_torch in (True, False):
        out = tmp_path / f"run-{with_torch}"
        command = ["thin", "--detector", "ggcnn2", "--episodes", "1", "--workers", "0", "--camera", "ray"]
        played = bench([*command, "--no-report", "--quiet", "--out", str(out)], tmp_path, with_torch)
        assert played.returncode == 0, played.stderr
        (line,) = (out / "episodes.jsonl").read_text().splitlines()
        row = json.loads(line)
        rows.append({key: value for key, value in row.items() if key != "timing"})
    assert rows[0] == rows[1]


@pytest.mark.parametrize(
    "command",
    [
        ["thin", "--detector", "ggcnn2", "--runtime", "torch"],
        ["thin", "--detector", "unet", "--weights", "unet.safetensors"],
    ],
)
def test_what_needs_torch_says_so_where_there_is_none(command: list[str], tmp_path: Path) -> None:
    saved(tmp_path / "unet.safetensors", "unet", {})
    played = bench([*command, "--episodes", "1", "--workers", "0"], tmp_path, with_torch=False)
    assert played.returncode == 2
    assert played.stderr.count("\n") == 1
    assert "needs torch, which is not installed; allowed: pip install 'mpgrasp[torch]'" in played.stderr


def bench(command: list[str], folder: Path, with_torch: bool) -> subprocess.CompletedProcess[str]:
    """Run the benchmark in a process of its own, with torch or as if there were none."""
    code = "import sys, runpy\n"
    if not with_torch:
        code += "sys.modules['torch'] = None\n"
    code += "runpy.run_module('mpgrasp.bench', run_name='__main__', alter_sys=True)\n"
    return subprocess.run(
        [sys.executable, "-c", code, *command],
        cwd=folder,
        env={**os.environ, "MPGRASP_CACHE": str(folder / f"cache-{with_torch}")},
        capture_output=True,
        text=True,
    )


def _metadata(file: Path) -> dict[str, str]:
    from safetensors import safe_open

    with safe_open(file, framework="np") as opened:
        return dict(opened.metadata())
