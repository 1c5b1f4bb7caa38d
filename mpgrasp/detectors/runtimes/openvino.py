"""Networks in OpenVINO (https://docs.openvino.ai), compiled once and kept on disk.

Converting and compiling takes seconds, reading what was compiled a fraction of one. A file in the cache is
named after all that it was made from: weights, network code, precision, versions and processor.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import hashlib
import importlib
import inspect
import json
import logging
import os
import sys
import warnings
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from mpgrasp import paths
from mpgrasp.detectors.networks.weights import NetworkWeights
from mpgrasp.files.atomic import replace_file
from mpgrasp.forking import OPENVINO, refuse_inherited, starting

Float32 = NDArray[np.float32]

KEPT = 32
"""Compiled networks that are kept on disk; the ones unused for longest go first."""

_DEVICE = "CPU"
_DIGEST = 32  # [bytes] of SHA-256, in front of a cached network
_log = logging.getLogger(__name__)


class OpenVinoRuntime:
    """A network compiled by OpenVINO for this processor; raises whatever OpenVINO does.

    Args:
        weights: of the network, which is left as it is.
        precision: "bf16" or "f32"; by default the faster one that the processor has.
    """

    device = "cpu"

    def __init__(self, weights: NetworkWeights, precision: str | None = None) -> None:
        precision = precision or openvino_precision()
        if precision is None:
            raise ImportError("openvino cannot be imported")
        self.name = f"openvino {precision}"
        settings = {
            "INFERENCE_PRECISION_HINT": precision,
            "INFERENCE_NUM_THREADS": torch.get_num_threads(),
            "PERFORMANCE_HINT": "LATENCY",
            "NUM_STREAMS": 1,
            # pinned, processes of one thread each would all sit on the first core
            "ENABLE_CPU_PINNING": False,
        }
        file = _cache_file(weights, settings)
        blob = _read(file)
        self.cached = blob is not None
        if blob is None:
            blob = _core().compile_model(_convert(weights), _DEVICE, settings).export_model().getvalue()
            _write(file, blob)
        # what was just compiled is read back too, so that the first run is like all others
        self._request = _core().import_model(blob, _DEVICE, settings).create_infer_request()

    def __call__(self, image: Float32) -> Float32:
        refuse_inherited(OPENVINO)
        x = np.ascontiguousarray(image[None], np.float32)
        outputs = self._request.infer([x], share_inputs=True, share_outputs=True)
        return np.array(outputs[0][0], np.float32)


def openvino_precision() -> str | None:
    """Return "bf16" where the processor has instructions for it, else "f32"; None without OpenVINO."""
    try:
        capabilities = _core().get_property(_DEVICE, "OPTIMIZATION_CAPABILITIES")
    except (ImportError, RuntimeError) as error:
        _log.info("no OpenVINO here: %s", error)
        return None
    return "bf16" if "BF16" in capabilities else "f32"


def _core() -> Any:
    starting(OPENVINO)
    return _made_core()


@functools.cache
def _made_core() -> Any:
    return _openvino().Core()


def _openvino() -> ModuleType:
    """Import the library without its telemetry: who benchmarks a grasp has not agreed to report it."""
    name = "openvino_telemetry"
    if "openvino" in sys.modules:
        return sys.modules["openvino"]
    before = sys.modules.get(name)
    sys.modules[name] = None  # type: ignore[assignment]  # as if it were not installed, which OpenVINO allows
    try:
        openvino = importlib.import_module("openvino")
    finally:
        if before is None:
            del sys.modules[name]
        else:
            sys.modules[name] = before
    return openvino


class _OneOutput(nn.Module):
    """A network with its heads in one tensor (n, 4, H, W)."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return torch.cat(tuple(self.network(image)), dim=1)


def _convert(weights: NetworkWeights) -> Any:
    """Return OpenVINO's model of the network for one image; it folds batch norms when it compiles."""
    shape = _shape(weights)
    network = _OneOutput(copy.deepcopy(weights.network).cpu().float().eval())
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("ignore")  # tracing warns of every shape that it takes for a constant
        return _openvino().convert_model(network, example_input=torch.zeros(shape), input=[shape])


def _shape(weights: NetworkWeights) -> tuple[int, int, int, int]:
    return 1, weights.input.channels, weights.input.size, weights.input.size


def _cache_file(weights: NetworkWeights, settings: dict[str, Any]) -> Path | None:
    folder = paths.cache_folder()
    if folder is None:
        return None
    openvino = _openvino()
    about = {
        "versions": [openvino.__version__, torch.__version__],
        "processor": _core().get_property(_DEVICE, "FULL_DEVICE_NAME"),
        "capabilities": sorted(_core().get_property(_DEVICE, "OPTIMIZATION_CAPABILITIES")),
        "compiled": settings,
        "network": [weights.name, dict(weights.settings), _shape(weights)],
    }
    digest = hashlib.sha256(json.dumps(about, sort_keys=True, default=str).encode())
    layers = {type(layer) for layer in weights.network.modules()}
    sources = {inspect.getfile(layer) for layer in layers if not layer.__module__.startswith("torch.")}
    for source in sorted({*sources, __file__}):
        digest.update(Path(source).read_bytes())
    for key, value in sorted(weights.network.state_dict().items()):
        digest.update(key.encode())
        digest.update(value.detach().cpu().contiguous().numpy().tobytes())
    return folder / "openvino" / f"{weights.name}-{digest.hexdigest()[:32]}.ov"


def _read(file: Path | None) -> bytes | None:
    """Read a compiled network; None if it is not there or not whole."""
    if file is None:
        return None
    try:
        content = file.read_bytes()
    except OSError:
        return None
    blob = content[_DIGEST:]
    if hashlib.sha256(blob).digest() != content[:_DIGEST]:
        return None
    with contextlib.suppress(OSError):
        os.utime(file)
    return blob


def _write(file: Path | None, blob: bytes) -> None:
    """Keep a compiled network; where that is not possible the next start takes as long as this one."""
    if file is None:
        return
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, hashlib.sha256(blob).digest() + blob)
        kept = sorted(file.parent.glob("*.ov"), key=lambda f: f.stat().st_mtime, reverse=True)
        for old in kept[KEPT:]:
            old.unlink(missing_ok=True)
    except OSError as error:
        _log.info("a compiled network cannot be kept: %s", error)
