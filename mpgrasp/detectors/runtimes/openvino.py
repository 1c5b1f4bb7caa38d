"""Networks in OpenVINO (https://docs.openvino.ai), compiled once and kept on disk.

Converting from torch takes seconds, compiling a graph or reading what was compiled a fraction of one. A file
in the cache is named after all that it was made from: weights, network code or graph, precision, versions and
processor. Reading it takes no torch.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import json
import logging
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mpgrasp import paths
from mpgrasp.extras import is_installed
from mpgrasp.files.atomic import replace_file
from mpgrasp.forking import OPENVINO, refuse_inherited, starting

if TYPE_CHECKING:
    from mpgrasp.detectors.networks.weights import NetworkWeights
    from mpgrasp.detectors.runtimes.graph import Graph

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
        from mpgrasp.detectors.runtimes.conversion import content, convert, shape

        about = [weights.name, dict(weights.settings), shape(weights)]
        self._compile(
            weights.name, about, content(weights), lambda: convert(weights, openvino()), _settings(precision)
        )

    @classmethod
    def of_graph(
        cls, graph: Graph, tensors: Mapping[str, NDArray[Any]], precision: str | None = None
    ) -> OpenVinoRuntime:
        """Return a network with these weights, compiled from its graph: the same bits, and no torch.

        Args:
            graph: of the network.
            tensors: its weights, by name.
            precision: "bf16" or "f32"; by default the faster one that the processor has.
        """
        made = cls.__new__(cls)
        facts = graph.facts
        numbers = (part for key in sorted(tensors) for part in (key.encode(), tensors[key].tobytes()))
        made._compile(
            facts.network,
            [facts.network, facts.config, facts.image],
            (graph.layers, graph.constants, *numbers),
            lambda: graph.filled(tensors, openvino(), _core()),
            _settings(precision),
        )
        return made

    @classmethod
    def of_file(cls, file: Path, settings: dict[str, Any]) -> OpenVinoRuntime | None:
        """Return the network in a file of the cache, compiled with such settings; None if it is not whole."""
        blob = _read(file)
        if blob is None:
            return None
        made = cls.__new__(cls)
        made._load(blob, settings, True, file)
        return made

    def _compile(
        self,
        name: str,
        about: list[Any],
        content: Iterable[bytes],
        model: Callable[[], Any],
        settings: dict[str, Any],
    ) -> None:
        """Compile a network, or read what was compiled before under the hash of all that is said of it."""
        file = _cache_file(name, about, content, settings)
        blob = _read(file)
        cached = blob is not None
        if blob is None:
            blob = _core().compile_model(model(), _DEVICE, settings).export_model().getvalue()
            if not _write(file, blob):
                file = None
        # what was just compiled is read back too, so that the first run is like all others
        self._load(blob, settings, cached, file)

    def _load(self, blob: bytes, settings: dict[str, Any], cached: bool, file: Path | None) -> None:
        self.name = f"openvino {settings['INFERENCE_PRECISION_HINT']}"
        self.cached, self.settings, self.file = cached, settings, file
        """True if it was compiled before; what it was compiled with; where it is kept, if it is."""
        self._request = _core().import_model(blob, _DEVICE, settings).create_infer_request()
        # its own tensors, filled and read in place: finding them takes longer than copying an image
        self._image, self._outputs = self._request.get_input_tensor(0), self._request.get_output_tensor(0)

    def __call__(self, image: Float32) -> Float32:
        refuse_inherited(OPENVINO)
        if (1, *image.shape) != tuple(self._image.shape):
            raise ValueError(f"{self.name}: an image of {image.shape}, not of {tuple(self._image.shape)[1:]}")
        self._image.data[0] = image
        self._request.infer(share_outputs=True)
        return np.array(self._outputs.data[0], np.float32)


def openvino_precision() -> str | None:
    """Return "bf16" where the processor has instructions for it, else "f32"; None without OpenVINO."""
    try:
        capabilities = _core().get_property(_DEVICE, "OPTIMIZATION_CAPABILITIES")
    except (ImportError, RuntimeError) as error:
        _log.info("no OpenVINO here: %s", error)
        return None
    return "bf16" if "BF16" in capabilities else "f32"


def compile_settings(precision: str, count: int) -> dict[str, Any]:
    """Return the settings with which networks are compiled, for so many threads."""
    return {
        "INFERENCE_PRECISION_HINT": precision,
        "INFERENCE_NUM_THREADS": count,
        "PERFORMANCE_HINT": "LATENCY",
        "NUM_STREAMS": 1,
        # pinned, processes of one thread each would all sit on the first core
        "ENABLE_CPU_PINNING": False,
    }


def threads() -> int:
    """Return how many threads torch computes on; imports it only where OMP_NUM_THREADS does not say so.

    Without torch it is the number of processors that this process may use.
    """
    said = os.environ.get("OMP_NUM_THREADS", "")
    if sys.modules.get("torch") is None and said.isdecimal() and int(said) > 0:
        return int(said)
    if not is_installed("torch"):
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    import torch

    return torch.get_num_threads()


def _settings(precision: str | None) -> dict[str, Any]:
    """Return the settings to compile with here, by default in the faster precision."""
    precision = precision or openvino_precision()
    if precision is None:
        raise ImportError("openvino cannot be imported")
    return compile_settings(precision, threads())


def machine() -> dict[str, Any]:
    """Return versions and processor, which decide what compiling makes."""
    return {
        "versions": [openvino().__version__, _torch_version()],
        "processor": _core().get_property(_DEVICE, "FULL_DEVICE_NAME"),
        "capabilities": sorted(_core().get_property(_DEVICE, "OPTIMIZATION_CAPABILITIES")),
    }


def _torch_version() -> str | None:
    try:
        return metadata.version("torch")
    except metadata.PackageNotFoundError:
        return None


def cache_folder() -> Path | None:
    """Return the folder in which compiled networks are kept; None where there is no cache."""
    folder = paths.cache_folder()
    return None if folder is None else folder / "openvino"


def _core() -> Any:
    starting(OPENVINO)
    return _made_core()


@functools.cache
def _made_core() -> Any:
    return openvino().Core()


def openvino() -> ModuleType:
    """Import the library without its telemetry: who benchmarks a grasp has not agreed to report it."""
    name = "openvino_telemetry"
    if "openvino" in sys.modules:
        return sys.modules["openvino"]
    before = sys.modules.get(name)
    sys.modules[name] = None  # type: ignore[assignment]  # as if it were not installed, which OpenVINO allows
    try:
        found = importlib.import_module("openvino")
    finally:
        if before is None:
            del sys.modules[name]
        else:
            sys.modules[name] = before
    return found


def _cache_file(
    name: str, about: list[Any], content: Iterable[bytes], settings: dict[str, Any]
) -> Path | None:
    folder = cache_folder()
    if folder is None:
        return None
    all_of_it = {**machine(), "compiled": settings, "network": about}
    digest = hashlib.sha256(json.dumps(all_of_it, sort_keys=True, default=str).encode())
    for part in content:
        digest.update(part)
    return folder / f"{name}-{digest.hexdigest()[:32]}.ov"


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


def _write(file: Path | None, blob: bytes) -> bool:
    """Keep a compiled network; where that is not possible the next start takes as long as this one."""
    if file is None:
        return False
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, hashlib.sha256(blob).digest() + blob)
        kept = sorted(file.parent.glob("*.ov"), key=lambda f: f.stat().st_mtime, reverse=True)
        for old in kept[KEPT:]:
            old.unlink(missing_ok=True)
    except OSError as error:
        _log.info("a compiled network cannot be kept: %s", error)
        return False
    return True
