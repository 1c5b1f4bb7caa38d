"""Networks on runtimes, and how long they take: all of predict(), the network alone, and the first call."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mpgrasp.depth import DepthFrame

if TYPE_CHECKING:
    from torch import nn

    from mpgrasp.detectors.network_detector import NetworkDetector
    from mpgrasp.detectors.networks.input import NetworkInput
    from mpgrasp.detectors.networks.weights import NetworkWeights
    from mpgrasp.detectors.runtimes.runtime import Runtime

WIDE = "dhrnet width 48"
"""DHRNet as wide as the authors'."""
RUNTIMES = ("torch plain", "torch", "openvino f32", "openvino bf16")
"""In the order of the figure."""
_CACHE = "MPGRASP_CACHE"


class Timed:
    """A runtime that notes how long its last call took [s]."""

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self.name, self.device, self.cached = runtime.name, runtime.device, runtime.cached
        self.seconds = 0.0

    def __call__(self, image: np.ndarray) -> np.ndarray:
        start = time.perf_counter()
        heads = self.runtime(image)
        self.seconds = time.perf_counter() - start
        return heads


@dataclass(kw_only=True)
class Entry:
    """A network on a runtime, and its times."""

    network: str
    detector: NetworkDetector
    timed: Timed
    first_call: dict[str, float | None]
    """Time to build the runtime and run it once, with an empty cache (cold) and a filled one (cached) [s]."""
    predict: list[float] = field(default_factory=list)
    """All of predict() [s]."""
    alone: list[float] = field(default_factory=list)
    """The network in it [s]."""


def weights_for(name: str) -> tuple[NetworkWeights, bool]:
    """A network, and whether its weights are the shipped ones; random ones where there are none.

    Raises:
        ConfigError: there is no such network.
    """
    from mpgrasp.detectors.networks.dhrnet import AUTHORS
    from mpgrasp.detectors.networks.input import NetworkInput
    from mpgrasp.detectors.networks.registry import build_network, declaration, default_weights
    from mpgrasp.detectors.networks.weights import NetworkWeights, load_weights

    if name != WIDE and default_weights(name).is_file():
        return load_weights(name), True
    key, settings = ("dhrnet", AUTHORS) if name == WIDE else (name, {})
    network = build_network(key, settings)
    image = NetworkInput(size=declaration(key).input_size)
    _settle(network, image)
    return NetworkWeights(name=key, network=network, settings=settings, input=image), False


def _settle(network: nn.Module, image: NetworkInput) -> None:
    """Let batch norms learn the range of random layers, whose outputs would grow from layer to layer."""
    import torch

    norms = [layer for layer in network.modules() if isinstance(layer, torch.nn.BatchNorm2d)]
    for norm in norms:
        norm.momentum = None  # a mean over what is seen: once is enough
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        network.train()(torch.randn(2, image.channels, image.size, image.size, generator=generator))
    network.eval()


def make_runtime(weights: NetworkWeights, runtime: str) -> Runtime:
    """One of `RUNTIMES`, ready to be called."""
    from mpgrasp.detectors.runtimes.openvino import OpenVinoRuntime
    from mpgrasp.detectors.runtimes.torch_runtime import TorchRuntime

    if runtime.startswith("torch"):
        return TorchRuntime(weights, plain=runtime == "torch plain")
    return OpenVinoRuntime(weights, runtime.removeprefix("openvino "))


def available_runtimes() -> tuple[str, ...]:
    """Those of `RUNTIMES` that this machine has; bfloat16 only where the processor computes in it."""
    from mpgrasp.detectors.runtimes.openvino import openvino_precision

    last = {None: 2, "f32": 3, "bf16": 4}[openvino_precision()]
    return RUNTIMES[:last]


def first_call(weights: NetworkWeights, runtime: str) -> tuple[Runtime, float]:
    """A runtime, and the time [s] it took to make it and call it once."""
    image = np.zeros((weights.input.channels, weights.input.size, weights.input.size), np.float32)
    start = time.perf_counter()
    ready = make_runtime(weights, runtime)
    ready(image)
    return ready, time.perf_counter() - start


def make_entry(network: str, weights: NetworkWeights, runtime: str) -> Entry:
    """A network on a runtime, with the times of its first calls."""
    from mpgrasp.detectors.network_detector import NetworkDetector

    with _empty_cache():
        ready, cold = first_call(weights, runtime)
        cached = first_call(weights, runtime)[1] if runtime.startswith("openvino") else None
    timed = Timed(ready)
    detector = NetworkDetector(weights, runtime=timed)
    return Entry(network=network, detector=detector, timed=timed, first_call={"cold": cold, "cached": cached})


@contextmanager
def _empty_cache() -> Iterator[None]:
    before = os.environ.get(_CACHE)
    with tempfile.TemporaryDirectory() as folder:
        os.environ[_CACHE] = folder
        try:
            yield
        finally:
            del os.environ[_CACHE]
            if before is not None:
                os.environ[_CACHE] = before


def time_all(
    entries: Sequence[Entry], images: Sequence[DepthFrame], rounds: int, rng: np.random.Generator
) -> None:
    """Time every entry once a round, in random order; each call is timed whole and in its network."""
    for k in range(rounds):
        image = images[k % len(images)]
        for i in rng.permutation(len(entries)):
            entry = entries[i]
            for counted in (False, True):
                start = time.perf_counter()
                entry.detector.predict(image)
                if counted:
                    entry.predict.append(time.perf_counter() - start)
                    entry.alone.append(entry.timed.seconds)


def network_size(weights: NetworkWeights, shipped: bool) -> dict[str, Any]:
    """Parameters, FLOPs of an image, and whose weights they are."""
    from mpgrasp.detectors.networks.cost import flops, parameters

    image = weights.input
    return {
        "parameters": parameters(weights.network),
        "gflops": flops(weights.network, image.channels, image.size) / 1e9,
        "weights": "shipped" if shipped else "random",
    }
