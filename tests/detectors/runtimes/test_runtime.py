"""Laws of what computes a network: all find the same grasps, none compiles twice, none takes more threads."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors.__main__ import main
from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import build_network, default_weights
from mpgrasp.detectors.networks.weights import NetworkWeights, load_weights
from mpgrasp.detectors.runtimes import openvino as openvino_runtime
from mpgrasp.detectors.runtimes import runtime as runtimes
from mpgrasp.detectors.runtimes.openvino import OpenVinoRuntime, openvino_precision
from mpgrasp.detectors.runtimes.runtime import make_runtime, runtime_name
from mpgrasp.detectors.runtimes.torch_runtime import TorchRuntime
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down
from mpgrasp.grasp import GraspMap
from mpgrasp.inspection.agreement import Agreement, compare, grasps_apart, rendered_frames

needs_openvino = pytest.mark.skipif(openvino_precision() is None, reason="no OpenVINO for this processor")
SMALL = {"width": 4, "blocks": 1}
SIZE = 64


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def weights() -> NetworkWeights:
    """A small network with batch norms that do something."""
    generator = torch.Generator().manual_seed(1)
    torch.manual_seed(0)
    network = build_network("fcn", SMALL).eval()
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean = torch.randn(module.num_features, generator=generator)
            module.running_var = torch.rand(module.num_features, generator=generator) + 0.5
    return NetworkWeights(name="fcn", network=network, settings=SMALL, input=NetworkInput(size=SIZE))


def image(seed: int = 0, size: int = SIZE) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(1, size, size)).astype(np.float32)


def plain_heads(weights: NetworkWeights, x: np.ndarray) -> np.ndarray:
    with torch.inference_mode():
        return torch.cat(weights.network(torch.from_numpy(x)[None]), dim=1)[0].numpy()


def test_torch_in_any_layout_is_the_network_itself(weights: NetworkWeights) -> None:
    expected = plain_heads(weights, image())
    assert np.array_equal(TorchRuntime(weights, plain=True)(image()), expected)
    assert np.allclose(TorchRuntime(weights)(image()), expected, atol=1e-4 * np.abs(expected).max())
    assert np.array_equal(plain_heads(weights, image()), expected)  # folding was done on a copy


@needs_openvino
@pytest.mark.parametrize(("precision", "tolerance"), [("f32", 1e-4), ("bf16", 0.05)])
def test_openvino_is_the_network_up_to_its_precision(
    precision: str, tolerance: float, weights: NetworkWeights
) -> None:
    if precision == "bf16" and openvino_precision() != "bf16":
        pytest.skip("no bfloat16 on this processor")
    expected = plain_heads(weights, image())
    runtime = OpenVinoRuntime(weights, precision)
    assert runtime.name == f"openvino {precision}"
    assert np.abs(runtime(image()) - expected).max() < tolerance * np.abs(expected).max()


@needs_openvino
@pytest.mark.parametrize(
    ("name", "settings", "size"),
    [
        ("tfgrasp", {"embed": 16, "depths": (1, 1, 1, 1), "heads": (1, 1, 1, 1)}, 224),
        ("ggcnn2", {}, 64),
        ("ggcnn", {}, 60),
        ("fcn_residual", {}, 64),
        ("unet", {}, 64),
    ],
)
def test_every_network_runs_in_openvino(name: str, settings: dict[str, Any], size: int) -> None:
    torch.manual_seed(0)
    made = NetworkWeights(
        name=name,
        network=build_network(name, settings).eval(),
        settings=settings,
        input=NetworkInput(size=size),
    )
    expected = plain_heads(made, image(size=size))
    found = OpenVinoRuntime(made, "f32")(image(size=size))
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("runtime", ["torch", pytest.param("openvino", marks=needs_openvino)])
def test_the_same_image_gives_the_same_bits(runtime: str, weights: NetworkWeights) -> None:
    first = make_runtime(weights, runtime)
    heads = first(image())
    first(image(1))
    assert np.array_equal(first(image()), heads)
    assert np.array_equal(make_runtime(weights, runtime)(image()), heads)


@needs_openvino
def test_an_image_of_another_size_is_refused_and_never_stretched(weights: NetworkWeights) -> None:
    runtime = OpenVinoRuntime(weights, "f32")
    for wrong in (image()[0], image()[:, :1], np.concatenate([image(), image()])):
        with pytest.raises(ValueError, match="an image of"):
            runtime(wrong)


@needs_openvino
def test_heads_stay_as_they_are_when_the_next_image_comes(weights: NetworkWeights) -> None:
    runtime = make_runtime(weights, "openvino")
    heads = runtime(image())
    before = heads.copy()
    runtime(image(1))
    assert np.array_equal(heads, before)


@needs_openvino
def test_openvino_takes_as_many_threads_as_torch(weights: NetworkWeights) -> None:
    threads = torch.get_num_threads()
    try:
        for n in (1, 2):
            torch.set_num_threads(n)
            compiled = OpenVinoRuntime(weights)._request.get_compiled_model()
            assert compiled.get_property("INFERENCE_NUM_THREADS") == n
            assert not compiled.get_property("ENABLE_CPU_PINNING")
    finally:
        torch.set_num_threads(threads)


@needs_openvino
def test_a_network_is_compiled_once(weights: NetworkWeights, cache: Path) -> None:
    first, second = OpenVinoRuntime(weights), OpenVinoRuntime(weights)
    assert (first.cached, second.cached) == (False, True)
    assert len(list(cache.rglob("*.ov"))) == 1
    other = replace(weights, network=build_network("fcn", SMALL).eval())
    assert not OpenVinoRuntime(other).cached
    assert not OpenVinoRuntime(replace(weights, input=NetworkInput(size=SIZE + 32))).cached
    assert OpenVinoRuntime(weights).cached


@needs_openvino
@pytest.mark.parametrize("keep", [0, 20, 5000])
def test_a_damaged_cache_is_made_anew(keep: int, weights: NetworkWeights, cache: Path) -> None:
    heads = OpenVinoRuntime(weights)(image())
    (file,) = cache.rglob("*.ov")
    whole = file.read_bytes()
    file.write_bytes(whole[:keep])
    made = OpenVinoRuntime(weights)
    assert not made.cached
    assert np.array_equal(made(image()), heads)
    assert OpenVinoRuntime(weights).cached


@needs_openvino
def test_a_cache_that_cannot_be_written_only_costs_time(
    weights: NetworkWeights, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "file" / "cache"))
    made = OpenVinoRuntime(weights)
    assert not made.cached
    assert np.isfinite(made(image())).all()


@needs_openvino
def test_the_cache_does_not_grow_without_end(
    weights: NetworkWeights, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(openvino_runtime, "KEPT", 2)
    folder = cache / "openvino"
    folder.mkdir(parents=True)
    for age in range(4):
        old = folder / f"old{age}.ov"
        old.write_bytes(b"")
        os.utime(old, (1e9 - age, 1e9 - age))
    OpenVinoRuntime(weights)
    left = sorted(file.name for file in folder.iterdir())
    assert len(left) == 2
    assert "old0.ov" in left


@needs_openvino
def test_openvino_reports_to_nobody(tmp_path: Path) -> None:
    code = (
        "import sys, os; from pathlib import Path;"
        "from mpgrasp.detectors.runtimes.openvino import openvino_precision as p; p();"
        "assert 'openvino' in sys.modules;"
        "sys.exit('openvino_telemetry' in sys.modules or bool(list(Path.home().iterdir())))"
    )
    environment = {
        **os.environ,
        "HOME": str(tmp_path),
        "PYTHONPATH": str(Path(__file__).resolve().parents[3]),
    }
    assert subprocess.run([sys.executable, "-c", code], env=environment).returncode == 0


@pytest.mark.parametrize(
    ("asked", "cuda", "precision", "name"),
    [
        ("auto", False, "bf16", "openvino bf16"),
        ("auto", False, "f32", "openvino f32"),
        ("auto", False, None, "torch f32"),
        ("auto", True, "bf16", "torch f32, cuda"),
        ("torch", False, "bf16", "torch f32"),
        ("torch", True, "bf16", "torch f32, cuda"),
        ("openvino", True, "f32", "openvino f32"),
    ],
)
def test_what_is_taken_depends_on_what_is_there(
    asked: str, cuda: bool, precision: str | None, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: cuda)
    monkeypatch.setattr(runtimes, "openvino_precision", lambda: precision)
    assert runtime_name(asked) == name


def test_openvino_is_an_error_only_where_it_was_asked_for(
    weights: NetworkWeights, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(runtimes, "openvino_precision", lambda: None)
    with pytest.raises(ConfigError, match="OpenVINO cannot be used here"):
        NetworkDetector(weights, runtime="openvino")

    def fail(weights: NetworkWeights) -> None:
        raise RuntimeError("no such operation\nat some place")

    monkeypatch.setattr(runtimes, "openvino_precision", lambda: "bf16")
    monkeypatch.setattr(runtimes, "OpenVinoRuntime", fail)
    with pytest.raises(ConfigError, match="cannot run this network: no such operation; got 'fcn'"):
        NetworkDetector(weights, runtime="openvino").warm_up()
    detector = NetworkDetector(weights)
    detector.warm_up()
    assert detector.runtime == "torch f32"
    assert "no such operation" in caplog.text
    with pytest.raises(ConfigError, match="unknown runtime"):
        NetworkDetector(weights, runtime="onnx")


@pytest.mark.parametrize("runtime", ["torch", pytest.param("openvino", marks=needs_openvino)])
def test_getting_ready_is_counted_once_and_told(runtime: str, weights: NetworkWeights) -> None:
    detector = NetworkDetector(weights, runtime=runtime)
    name = detector.runtime
    assert detector.readiness == f"fcn: {name}, not ready yet"
    seconds = detector.warm_up()
    assert seconds > 0
    assert detector.warm_up() == seconds
    assert detector.runtime == name
    assert detector.readiness == f"fcn: {name}, ready in {seconds:.1f} s"
    if runtime == "openvino":
        again = NetworkDetector(weights, runtime=runtime)
        again.warm_up()
        assert again.readiness.endswith("s (cached)")


@pytest.fixture(scope="module")
def frames() -> list[DepthFrame]:
    """Rendered images of the benchmark's scenes, half of them with thin objects."""
    return [*rendered_frames("thin", 10, seed=1), *rendered_frames("unseen", 10, seed=1)]


@pytest.mark.parametrize("runtime", ["torch", pytest.param("openvino", marks=needs_openvino)])
@pytest.mark.parametrize("name", ["dhrnet", "ggcnn2"])
def test_every_runtime_finds_the_grasps_that_plain_torch_finds(
    name: str, runtime: str, frames: list[DepthFrame]
) -> None:
    loaded = load_weights(name)
    plain = NetworkDetector(loaded, runtime=TorchRuntime(loaded, plain=True))
    found = compare(NetworkDetector(loaded, runtime=runtime), plain, frames)
    assert len(found.distance) == len(frames) == 20
    assert found.share >= 0.95


def flat(quality: np.ndarray, angle: float = 0.0) -> GraspMap:
    shape = quality.shape
    return GraspMap(
        quality=quality.astype(np.float32),
        angle=np.full(shape, angle, np.float32),
        width=np.ones(shape, np.float32),
        depth=np.ones(shape, np.float32),
        intrinsics=CameraIntrinsics(fx=9, fy=9, cx=5, cy=5, width=shape[1], height=shape[0]),
        T_world_camera=looking_down([0.5, 0.0, 0.4]),
    )


def test_grasps_apart_are_measured_between_the_best_pixels_and_as_lines() -> None:
    empty = np.zeros((10, 10))
    first, second = empty.copy(), empty.copy()
    first[2, 3], second[5, 7] = 0.6, 0.9
    distance, angle = grasps_apart(flat(first, np.pi / 2 - 0.01), flat(second, -np.pi / 2 + 0.02))
    assert distance == pytest.approx(5.0)
    assert angle == pytest.approx(0.03, abs=1e-6)
    assert grasps_apart(flat(empty), flat(empty, 1.0)) == (0.0, 0.0)
    assert grasps_apart(flat(first), flat(empty))[0] == np.inf
    share = Agreement(
        distance=np.array([0.0, 2.0, 2.3, np.inf]), angle=np.deg2rad([0, 2.9, 0, 90]), milliseconds=(1, 2)
    )
    assert (share.same, share.share, share.good) == (2, 0.5, False)


def test_rendered_frames_are_those_of_the_seed() -> None:
    first, again, other = (next(rendered_frames("thin", 1, seed)) for seed in (0, 0, 1))
    assert np.array_equal(first.depth, again.depth, equal_nan=True)
    assert not np.array_equal(first.depth, other.depth, equal_nan=True)
    with pytest.raises(ConfigError, match="number of frames"):
        next(rendered_frames("thin", 0))


def test_the_check_command_tells_how_many_frames_agree(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["check", "ggcnn2", "--frames", "4", "--runtime", "torch"]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("ggcnn2: torch f32")
    assert "of plain torch on 4 of 4 frames (100.0 %)" in printed
    # a runtime that answers something else is found out
    wrong = TorchRuntime.__call__
    monkeypatch.setattr(
        TorchRuntime, "__call__", lambda self, x: wrong(self, x) if "plain" in self.name else wrong(self, -x)
    )
    assert main(command) == 1


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["check", "oracle"], "a detector without a runtime; got 'oracle'"),
        (["check", "dhrnet", "--runtime", "tpu"], "unknown runtime; got 'tpu'"),
        (["check", "dhrnet", "--frames", "0"], "argument --frames: unusable number; got '0'"),
        (["show", "dhrnet", "--runtime", "tpu"], "unknown runtime; got 'tpu'"),
    ],
)
def test_unusable_input_is_one_line_and_exit_code_2(
    command: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command) == 2
    error = capsys.readouterr().err
    assert error.startswith("mpgrasp: error: ")
    assert error.count("\n") == 1
    assert message in error


@needs_openvino
def test_weights_that_differ_in_one_number_are_compiled_apart(tmp_path: Path, cache: Path) -> None:
    state = load_file(default_weights("ggcnn2"))
    metadata = _metadata(default_weights("ggcnn2"))
    key = sorted(state)[0]
    for k in range(2):
        state[key] = state[key] + 1e-3 * k
        save_file(state, tmp_path / "w.safetensors", metadata=metadata)
        assert not OpenVinoRuntime(load_weights("ggcnn2", tmp_path / "w.safetensors")).cached
    assert len(list(cache.rglob("*.ov"))) == 2


def _metadata(file: Path) -> dict[str, str]:
    from safetensors import safe_open

    with safe_open(file, framework="pt") as opened:
        return dict(opened.metadata())
