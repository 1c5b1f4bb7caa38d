"""Graphs: networks for OpenVINO without their weights, so that a weights file can be used without torch.

A graph is the layers of one network with one set of settings and one size of image; its weights are inputs.
It is a zip of OpenVINO's own format and of facts that say which weights files it is for. Those of the shipped
networks are shipped; `python -m mpgrasp.detectors graph` makes those of other settings.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors

from mpgrasp.detectors.networks.description import WeightsDescription, opened
from mpgrasp.detectors.networks.entries import Entry, check_entries, check_numbers, stored_entries
from mpgrasp.detectors.networks.registry import default_weights
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file

FORMAT = "mpgrasp-graph-1"
SUFFIX = ".graph"
NETWORK_SOURCES = Path(__file__).resolve().parents[1] / "networks"
"""Folder of the modules that a graph may be made from."""

_LAYERS, _CONSTANTS, _FACTS = "layers.xml", "constants.bin", "facts.json"
_ANY_DAY = (1980, 1, 1, 0, 0, 0)  # a zip of the same graph has the same bytes


class GraphFacts(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Facts about a graph, which decide the weights files that it is for."""

    format: str
    network: str
    """Name in the registry of networks."""
    config: dict[str, Any]
    """All settings of the network."""
    defaults: dict[str, Any]
    """Settings that a weights file need not name."""
    image: tuple[int, int, int, int]
    """Shape of the input."""
    tensors: dict[str, tuple[tuple[int, ...], str]]
    """Shape and type of each tensor of the network's state dict."""
    sources: dict[str, str]
    """SHA-256 of the modules in `NETWORK_SOURCES` that it was made from, by name."""
    made_with: dict[str, str]
    """Versions of the libraries that made it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Graph:
    """A network for OpenVINO, and what it is for."""

    facts: GraphFacts
    layers: bytes
    """OpenVINO's description of the network, XML."""
    constants: bytes
    """Numbers in it that are no weights."""

    def filled(self, tensors: Mapping[str, NDArray[Any]], openvino: ModuleType, core: Any) -> Any:
        """Return OpenVINO's model of the network with these weights."""
        constants = openvino.Tensor(np.frombuffer(self.constants or b"\0", np.uint8).copy())
        model = core.read_model(self.layers, constants)
        for parameter in model.get_parameters():
            name = parameter.get_friendly_name()
            if name in tensors:
                value = openvino.op.Constant(np.ascontiguousarray(tensors[name], np.float32))
                for reader in parameter.output(0).get_target_inputs():
                    reader.replace_source_output(value.output(0))
                model.remove_parameter(parameter)
        model.validate_nodes_and_infer_types()
        return model

    def is_for(self, about: WeightsDescription) -> bool:
        """True if weights that say this of themselves are weights of this network."""
        facts, image = self.facts, about.input
        if not isinstance(about.settings, dict):
            return False
        settings = json.dumps({**facts.defaults, **about.settings}, sort_keys=True)
        return (
            facts.format == FORMAT
            and facts.network == about.network
            and settings == json.dumps(facts.config, sort_keys=True)
            and facts.image == (1, image.channels, image.size, image.size)
            and facts.sources == digests(facts.sources)
        )


def digests(names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of modules in `NETWORK_SOURCES` by name; of one that is not there, an empty text."""
    files = {name: NETWORK_SOURCES / Path(name).name for name in names}
    return {
        name: hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
        for name, file in files.items()
    }


def graph_files(name: str, weights: Path) -> tuple[Path, Path]:
    """Return where the graph of a weights file may be: beside it, or with the shipped weights."""
    return weights.with_suffix(SUFFIX), default_weights(name).with_suffix(SUFFIX)


def find_graph(about: WeightsDescription, weights: Path) -> Graph | None:
    """Return a graph for a weights file that says this of itself; None where there is none."""
    for file in graph_files(about.network, weights):
        graph = read_graph(file)
        if graph is not None and graph.is_for(about):
            return graph
    return None


def read_graph(file: Path) -> Graph | None:
    """Return the graph in a file; None where there is no file, or it is damaged."""
    try:
        with zipfile.ZipFile(file) as parts:
            facts = msgspec.json.decode(parts.read(_FACTS), type=GraphFacts)
            return Graph(facts=facts, layers=parts.read(_LAYERS), constants=parts.read(_CONSTANTS))
    except (OSError, zipfile.BadZipFile, KeyError, ValueError, msgspec.MsgspecError):
        return None


def write_graph(file: Path, graph: Graph) -> None:
    """Write a graph; the same one always has the same bytes.

    Raises:
        OutputError: the file cannot be written.
    """
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as parts:
        facts = msgspec.json.format(msgspec.json.encode(graph.facts, order="sorted"), indent=1)
        for name, content in ((_FACTS, facts), (_LAYERS, graph.layers), (_CONSTANTS, graph.constants)):
            parts.writestr(zipfile.ZipInfo(name, _ANY_DAY), content, zipfile.ZIP_DEFLATED)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, made.getvalue())
    except OSError as error:
        raise OutputError(f"a graph cannot be written: {error}", got=str(file)) from error


def read_tensors(graph: Graph, content: bytes, weights: Path) -> dict[str, NDArray[Any]] | None:
    """Return the tensors of a weights file, checked; None where only torch can read them (bfloat16).

    Args:
        graph: of the network that they are for.
        content: bytes of the file.
        weights: the file, for what is said of it.

    Raises:
        WeightsError: they do not fit the network, or are no numbers.
    """
    needed = {key: Entry(*entry) for key, entry in graph.facts.tensors.items()}
    with opened(weights) as file:
        check_entries(stored_entries(file), needed, weights)
    try:
        tensors = load_tensors(content)
    except (KeyError, TypeError, SafetensorError):
        return None
    check_numbers(tensors, weights)
    return tensors
