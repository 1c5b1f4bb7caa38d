"""Laws of compiled networks: found by the bytes of their weights file alone, without torch, or not at all."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from toy_networks import SMALL, frame, random_weights

from mpgrasp.detectors import network_detector
from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.networks.weights import save_weights
from mpgrasp.detectors.runtimes.compiled import find
from mpgrasp.detectors.runtimes.openvino import openvino_precision
from mpgrasp.exceptions import WeightsError

pytestmark = pytest.mark.skipif(openvino_precision() is None, reason="no OpenVINO for this processor")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    torch.manual_seed(0)
    save_weights(tmp_path / "dhrnet.safetensors", random_weights("dhrnet", SMALL))
    return tmp_path / "dhrnet.safetensors"


def load(file: Path) -> NetworkDetector:
    return NetworkDetector.load("dhrnet", file, runtime="openvino")


def used(file: Path) -> NetworkDetector:
    detector = load(file)
    detector.warm_up()
    return detector


def test_a_weights_file_is_found_compiled_the_second_time_with_the_same_maps(file: Path) -> None:
    assert find("dhrnet", file) is None
    first = used(file)
    assert find("dhrnet", file) is not None
    second = load(file)
    assert second.readiness.endswith("not ready yet")
    for array in ("quality", "angle", "width"):
        assert np.array_equal(getattr(first.predict(frame()), array), getattr(second.predict(frame()), array))
    assert second.readiness.endswith("(cached)")
    assert (first.name, first.runtime, first.reads_colour) == (
        second.name,
        second.runtime,
        second.reads_colour,
    )
    states = (detector.weights.network.state_dict() for detector in (first, second))
    assert all(torch.equal(a, b) for a, b in zip(*(state.values() for state in states), strict=True))


def test_a_compiled_network_takes_no_torch(file: Path) -> None:
    code = (
        "import sys; from pathlib import Path; import numpy as np\n"
        "from mpgrasp.detectors import make_detector\n"
        "from mpgrasp.depth import CameraIntrinsics, DepthFrame\n"
        "detector = make_detector('dhrnet', sys.argv[1], 'openvino'); detector.warm_up()\n"
        "camera = CameraIntrinsics(fx=385., fy=385., cx=319.5, cy=239.5, width=640, height=480)\n"
        "depth = np.full((480, 640), .4, np.float32); depth[200:260, 300:330] -= .02\n"
        "found = detector.predict(DepthFrame(depth=depth, intrinsics=camera, T_world_camera=np.eye(4)))\n"
        "print(float(found.quality.sum()), 'torch' in sys.modules)\n"
    )
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    said = [
        subprocess.run(
            [sys.executable, "-c", code, str(file)],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for _ in range(2)
    ]
    assert [torch_loaded for _, torch_loaded in said] == ["True", "False"]
    assert said[0][0] == said[1][0]


def test_other_bytes_or_another_name_are_not_found(file: Path) -> None:
    used(file)
    assert find("ggcnn", file) is None
    torch.manual_seed(1)
    save_weights(file, random_weights("dhrnet", SMALL))
    assert find("dhrnet", file) is None
    assert find("dhrnet", file.with_name("missing.safetensors")) is None
    with pytest.raises(WeightsError, match="no such weights file"):
        load(file.with_name("missing.safetensors"))


@pytest.mark.parametrize("kind", ["*.ov", "compiled/*.json"])
def test_what_is_damaged_in_the_cache_is_not_found(kind: str, file: Path, cache: Path) -> None:
    expected = used(file).predict(frame()).quality
    (kept,) = cache.rglob(kind)
    kept.write_bytes(kept.read_bytes()[:-20])
    assert find("dhrnet", file) is None
    assert np.array_equal(used(file).predict(frame()).quality, expected)
    assert find("dhrnet", file) is not None


def test_a_note_with_an_unusable_input_is_not_believed(file: Path, cache: Path) -> None:
    used(file)
    (note,) = cache.rglob("compiled/*.json")
    row = json.loads(note.read_text())
    note.write_text(json.dumps({**row, "input": {**row["input"], "size": -1}}))
    assert find("dhrnet", file) is None


def test_a_file_that_changes_while_it_is_read_is_not_remembered(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    marks = iter("ab")
    monkeypatch.setattr(network_detector, "fingerprint", lambda _: next(marks))
    used(file)
    assert find("dhrnet", file) is None


def test_a_file_that_changes_before_the_network_is_compiled_stays_unknown(file: Path) -> None:
    detector = load(file)
    before = file.read_bytes()
    torch.manual_seed(1)
    save_weights(file, random_weights("dhrnet", SMALL))
    detector.warm_up()
    assert find("dhrnet", file) is None
    file.write_bytes(before)
    assert find("dhrnet", file) is not None
