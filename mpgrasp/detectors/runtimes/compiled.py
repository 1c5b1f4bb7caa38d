"""Networks that are compiled without torch: from a graph, or found by their weights file as compiled before.

What a weights file says and holds was checked when it was read for the first time. A note in the cache says,
for those bytes, this code, these versions and this processor, where the compiled network is and how its image
and its widths are to be taken.
"""

from __future__ import annotations

import hashlib
import json
import logging
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from mpgrasp.detectors.networks.calibration import Calibration
from mpgrasp.detectors.networks.description import check_name, check_weights_file, read_header
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.runtimes.graph import find_graph, read_tensors
from mpgrasp.detectors.runtimes.openvino import (
    OpenVinoRuntime,
    cache_folder,
    compile_settings,
    machine,
    openvino_precision,
    threads,
)
from mpgrasp.detectors.runtimes.runtime import Runtime, make_runtime, runtime_name
from mpgrasp.exceptions import ConfigError
from mpgrasp.extras import missing_library, not_installed
from mpgrasp.files.cache import load_result, store_result

if TYPE_CHECKING:
    from mpgrasp.detectors.networks.weights import NetworkWeights

_KIND = "compiled"
_log = logging.getLogger(__name__)


class _Note(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the cache tells of a weights file."""

    input: dict[str, Any]
    width_px: float
    file: str
    calibration: dict[str, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class CompiledNetwork:
    """A network that is ready to be run, and what has to be known to use it."""

    name: str
    """Name in the registry of networks."""
    input: NetworkInput
    width_px: float
    """Opening that a width output of 1 stands for, in pixels of the network's image [px]."""
    runtime: Runtime
    weights: Path
    """The file that it was made from."""
    calibration: Calibration | None = None
    """Of the claimed quality, if it was measured."""


def fingerprint(weights: Path) -> str | None:
    """Return the SHA-256 of a weights file; None where it cannot be read."""
    try:
        return hashlib.sha256(weights.read_bytes()).hexdigest()
    except OSError:
        return None


def find(name: str, weights: Path) -> CompiledNetwork | None:
    """Return the compiled network of a weights file; None unless it was remembered, and is whole.

    Args:
        name: in the registry of networks.
        weights: the file.
    """
    mark = fingerprint(weights)
    if mark is None:
        return None
    precision = openvino_precision()
    folder = cache_folder()
    if precision is None or folder is None:
        return None
    settings = compile_settings(precision, threads())
    note = load_result(_KIND, _key(name, mark, settings), _Note)
    if note is None:
        return None
    try:
        image = NetworkInput(**note.input)
        calibration = None if note.calibration is None else Calibration(**note.calibration)
    except (ConfigError, TypeError):
        return None
    runtime = OpenVinoRuntime.of_file(folder / Path(note.file).name, settings)
    if runtime is None:
        return None
    return CompiledNetwork(
        name=name,
        input=image,
        width_px=note.width_px,
        runtime=runtime,
        weights=weights,
        calibration=calibration,
    )


def of_graph(name: str, weights: Path) -> CompiledNetwork | None:
    """Return the network of a weights file, compiled from its graph; None where it has none.

    Raises:
        WeightsError: the file is missing, unreadable or made for another network.
    """
    if openvino_precision() is None or weights.suffix != ".safetensors":
        return None
    about = read_header(check_weights_file(weights))
    check_name(about, name, weights)
    graph = find_graph(about, weights)
    if graph is None:
        return None
    content = weights.read_bytes()
    tensors = read_tensors(graph, content, weights)
    if tensors is None:
        return None
    try:
        runtime = OpenVinoRuntime.of_graph(graph, tensors)
    except RuntimeError as error:  # a graph of a later version, say
        _log.info("%s: its graph is of no use here: %s", name, error)
        return None
    made = CompiledNetwork(
        name=name,
        input=about.input,
        width_px=about.width_px,
        runtime=runtime,
        weights=weights,
        calibration=about.calibration,
    )
    mark = hashlib.sha256(content).hexdigest()
    if mark == fingerprint(weights):  # what was read first, its description, was of the same file
        remember(made, mark)
    return made


def remember(network: CompiledNetwork, mark: str) -> None:
    """Have the network of a weights file found the next time, if OpenVINO compiled it and it is kept.

    Args:
        network: what was read from the file and compiled.
        mark: fingerprint of the file.
    """
    runtime = network.runtime
    if isinstance(runtime, OpenVinoRuntime) and runtime.file is not None:
        note = _Note(
            input=asdict(network.input),
            width_px=network.width_px,
            file=runtime.file.name,
            calibration=None if network.calibration is None else asdict(network.calibration),
        )
        store_result(_KIND, _key(network.name, mark, runtime.settings), note)


def without_torch(name: str, weights: Path) -> CompiledNetwork | None:
    """Return the network of a weights file as it was compiled before, or from its graph; None where it needs
    torch.

    Raises:
        WeightsError: the file is missing, unreadable or made for another network.
    """
    return find(name, weights) or of_graph(name, weights)


def made_ready(name: str, weights: Path) -> CompiledNetwork:
    """Return a network with the fastest runtime here: as it was compiled before, or as it is compiled now.

    Raises:
        ConfigError, WeightsError: it cannot be used.
    """
    if runtime_name("auto").startswith("openvino"):
        found = without_torch(name, weights)
        if found is not None:
            return found
    mark = fingerprint(weights)
    read = read_in_torch(name, weights)
    made = of_weights(read, make_runtime(read), weights)
    if mark is not None and mark == fingerprint(weights):
        remember(made, mark)
    return made


def read_in_torch(name: str, weights: Path) -> NetworkWeights:
    """Return a network with the weights of a file, in torch.

    Raises:
        ConfigError: there is no torch here.
        WeightsError: the file is missing, unreadable or made for another network.
    """
    try:
        from mpgrasp.detectors.networks.weights import load_weights
    except ModuleNotFoundError as error:
        if missing_library(error) is None:
            raise
        raise not_installed("torch", f"{name}, as it is asked for,") from error
    return load_weights(name, weights)


def of_weights(read: NetworkWeights, runtime: Runtime, file: Path) -> CompiledNetwork:
    """Return a network that was read from a file, with what computes it."""
    return CompiledNetwork(
        name=read.name,
        input=read.input,
        width_px=read.width_px,
        runtime=runtime,
        weights=file,
        calibration=read.calibration,
    )


def _key(name: str, mark: str, settings: dict[str, Any]) -> str:
    """Return the hash of all that decides a compiled network."""
    digest = hashlib.sha256(json.dumps([name, mark, machine(), settings], sort_keys=True).encode())
    here = Path(__file__).parent
    for source in sorted([*here.glob("*.py"), *(here.parent / "networks").glob("*.py")]):
        digest.update(hashlib.sha256(source.read_bytes()).digest())
    return digest.hexdigest()
