"""Networks that were checked and compiled before, found by their weights file: torch is not needed any more.

What a weights file says and holds was checked when it was read for the first time. A note in the cache says,
for those bytes, this code, these versions and this processor, where the compiled network is and how its image
and its widths are to be taken.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from mpgrasp.detectors.networks.calibration import Calibration
from mpgrasp.detectors.networks.input import NetworkInput
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
from mpgrasp.files.cache import load_result, store_result

if TYPE_CHECKING:
    from mpgrasp.detectors.networks.weights import NetworkWeights

_KIND = "compiled"


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


def remember(weights: NetworkWeights, mark: str, runtime: OpenVinoRuntime) -> None:
    """Have the network of a weights file found the next time.

    Args:
        weights: what was read from the file.
        mark: fingerprint of the file.
        runtime: what was compiled.
    """
    if runtime.file is not None:
        scale = None if weights.calibration is None else asdict(weights.calibration)
        note = _Note(
            input=asdict(weights.input),
            width_px=weights.width_px,
            file=runtime.file.name,
            calibration=scale,
        )
        store_result(_KIND, _key(weights.name, mark, runtime.settings), note)


def made_ready(name: str, weights: Path) -> CompiledNetwork:
    """Return a network with the fastest runtime here: as it was compiled before, or as it is compiled now.

    Raises:
        ConfigError, WeightsError: it cannot be used.
    """
    if runtime_name("auto").startswith("openvino"):
        found = find(name, weights)
        if found is not None:
            return found
    from mpgrasp.detectors.networks.weights import load_weights

    mark = fingerprint(weights)
    read = load_weights(name, weights)
    ready = make_runtime(read)
    if mark is not None and mark == fingerprint(weights) and isinstance(ready, OpenVinoRuntime):
        remember(read, mark, ready)
    return of_weights(read, ready, weights)


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
