"""Laws of the inference server: the heads of an image are those of that image alone, whoever else asks."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from toy_networks import SMALL, frame, random_weights

from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.networks.weights import save_weights
from mpgrasp.detectors.runtimes import server
from mpgrasp.detectors.runtimes.server import ADDRESS, inference_server
from mpgrasp.detectors.runtimes.shared import SharedRuntime
from mpgrasp.detectors.runtimes.torch_runtime import TorchBatch
from mpgrasp.exceptions import ConfigError, WeightsError

SHAPE = (1, 224, 224)


pytestmark = pytest.mark.xdist_group("shared memory")  # which one test counts, of all processes


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    torch.manual_seed(0)
    save_weights(tmp_path / "dhrnet.safetensors", random_weights("dhrnet", SMALL))
    return tmp_path / "dhrnet.safetensors"


@pytest.fixture
def running() -> Iterator[None]:
    with inference_server():
        yield


def image(seed: int) -> np.ndarray[Any, Any]:
    return np.random.default_rng(seed).normal(size=SHAPE).astype(np.float32)


def blocks() -> set[str]:
    return {path.name for path in Path("/dev/shm").glob("psm_*")}


@pytest.mark.usefixtures("running")
def test_a_shared_network_has_the_maps_of_one_of_its_own(file: Path) -> None:
    own, shared = (NetworkDetector.load("dhrnet", file, runtime=name) for name in ("auto", "shared"))
    assert (own.name, own.reads_colour) == (shared.name, shared.reads_colour)
    for array in ("quality", "angle", "width"):
        assert np.array_equal(getattr(own.predict(frame()), array), getattr(shared.predict(frame()), array))
    assert shared.runtime == f"shared {own.runtime}"


def ask(file: str, seeds: list[int], answers: Any) -> None:
    runtime = SharedRuntime("dhrnet", Path(file))
    answers.put([(seed, runtime(image(seed))) for seed in seeds])
    runtime.close()


@pytest.mark.usefixtures("running")
def test_everybody_gets_the_heads_of_their_own_images(file: Path) -> None:
    alone = SharedRuntime("dhrnet", file)
    expected = {seed: alone(image(seed)) for seed in range(12)}
    answers: Any = multiprocessing.get_context("spawn").Queue()
    seeds = [[0, 3, 6, 9], [1, 4, 7, 10], [2, 5, 8, 11]]
    threads = [threading.Thread(target=ask, args=(str(file), mine, answers)) for mine in seeds]
    for thread in threads:
        thread.start()
    found = [pair for _ in threads for pair in answers.get(timeout=60)]
    for thread in threads:
        thread.join()
    assert sorted(seed for seed, _ in found) == [*range(12)]
    assert all(np.array_equal(heads, expected[seed]) for seed, heads in found)


@pytest.mark.parametrize("size", [1, 3, 8])
def test_the_heads_of_an_image_in_a_batch_are_those_of_the_image_alone(size: int) -> None:
    torch.manual_seed(0)
    weights = random_weights("dhrnet", SMALL)
    batch = TorchBatch(weights, size, device="cpu")
    images = [image(seed) for seed in range(7)]
    together = batch.all_of(images)
    assert all(np.array_equal(heads, batch(one)) for heads, one in zip(together, images, strict=True))
    with torch.inference_mode():
        plain = [
            torch.cat(weights.network.eval()(torch.from_numpy(one)[None]), 1)[0].numpy() for one in images
        ]
    for heads, right in zip(together, plain, strict=True):
        assert np.allclose(heads, right, atol=1e-4 * np.abs(right).max())


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
def test_on_a_gpu_an_image_alone_and_among_others_has_the_same_bits(file: Path) -> None:
    torch.manual_seed(0)
    batch = TorchBatch(random_weights("dhrnet", SMALL))
    assert "bf16" in batch.name
    images = [image(seed) for seed in range(20)]
    assert all(
        np.array_equal(heads, batch(one)) for heads, one in zip(batch.all_of(images), images, strict=True)
    )


def test_what_was_shared_is_freed_when_a_client_leaves_dies_or_the_server_ends(file: Path) -> None:
    before = blocks()
    with inference_server():
        leaving, staying = SharedRuntime("dhrnet", file), SharedRuntime("dhrnet", file)
        code = (
            "import sys, time; from pathlib import Path\n"
            "from mpgrasp.detectors.runtimes.shared import SharedRuntime\n"
            "runtime = SharedRuntime('dhrnet', Path(sys.argv[1]))\n"
            "print('here', flush=True); time.sleep(60)\n"
        )
        killed = subprocess.Popen([sys.executable, "-c", code, str(file)], stdout=subprocess.PIPE)
        assert killed.stdout is not None
        assert killed.stdout.readline() == b"here\n"
        assert len(blocks() - before) == 3
        leaving.close()
        killed.send_signal(signal.SIGKILL)
        killed.communicate()
        limit = time.monotonic() + 20
        while len(blocks() - before) > 1 and time.monotonic() < limit:
            time.sleep(0.05)
        assert len(blocks() - before) == 1
        assert np.isfinite(staying(image(0))).all()
    assert not blocks() - before
    with pytest.raises(ConfigError, match="the inference server is gone"):
        staying(image(0))


def test_without_a_server_nothing_is_shared(file: Path) -> None:
    with pytest.raises(ConfigError, match="no inference server here; got 'shared'"):
        NetworkDetector.load("dhrnet", file, runtime="shared")


@pytest.mark.usefixtures("running")
def test_a_stranger_without_the_key_is_not_let_in_and_harms_nobody(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key, address = os.environ[ADDRESS].split("@")
    with monkeypatch.context() as other:
        other.setenv(ADDRESS, f"{'0' * len(key)}@{address}")
        with pytest.raises(ConfigError, match="inference server is gone"):
            SharedRuntime("dhrnet", file)
    assert np.isfinite(SharedRuntime("dhrnet", file)(image(0))).all()


@pytest.mark.usefixtures("running")
def test_weights_that_cannot_be_used_are_refused_to_those_who_ask_alone(file: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.safetensors"
    bad.write_bytes(b"no weights")
    with pytest.raises(WeightsError, match="weights cannot be read"):
        SharedRuntime("dhrnet", bad)
    runtime = SharedRuntime("dhrnet", file)
    assert np.isfinite(runtime(image(0))).all()
    with pytest.raises(ConfigError, match="an image of another size"):
        runtime(image(0)[:, :100])


def test_a_server_that_does_not_start_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "START_LIMIT", 0.0)
    with pytest.raises(ConfigError, match="the inference server does not start"), inference_server():
        raise AssertionError("it has started")
    assert ADDRESS not in os.environ
