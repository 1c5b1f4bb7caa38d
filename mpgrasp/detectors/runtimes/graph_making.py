"""Making of graphs: a network is traced in torch with its weights as inputs, once, for all of its weights."""

from __future__ import annotations

import json
import sys
import tempfile
import warnings
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from types import ModuleType

import torch
from torch import nn

from mpgrasp.detectors.networks.registry import build_network, declaration
from mpgrasp.detectors.networks.state import entries
from mpgrasp.detectors.networks.weights import NetworkWeights
from mpgrasp.detectors.runtimes.conversion import OneOutput, shape
from mpgrasp.detectors.runtimes.graph import FORMAT, Graph, GraphFacts, digests
from mpgrasp.exceptions import ConfigError

_NETWORKS = "mpgrasp.detectors.networks."
_COUNTS = "num_batches_tracked"  # of batch norms; only training reads them


class _Open(nn.Module):
    """A network whose weights are arguments, after the image."""

    def __init__(self, network: nn.Module, names: list[str]) -> None:
        super().__init__()
        self.__dict__["inner"] = OneOutput(network)  # no submodule: its weights would be constants
        self.names = names

    def forward(self, image: torch.Tensor, *weights: torch.Tensor) -> torch.Tensor:
        inner: OneOutput = self.__dict__["inner"]
        modules = dict(inner.network.named_modules())
        for name, value in zip(self.names, weights, strict=True):
            owner, _, own = name.rpartition(".")
            module = modules[owner]
            kept = module._parameters if own in module._parameters else module._buffers
            kept[own] = value
        made: torch.Tensor = inner(image)
        return made


def _sources(module: str) -> set[str]:
    """Return the files of `NETWORK_SOURCES` that compute a network: its own, and those of its parts."""
    found: set[str] = set()
    waiting = {module}
    while waiting:
        here = sys.modules[waiting.pop()]
        found.add(Path(str(here.__file__)).name)
        parts = {getattr(part, "__module__", None) for part in vars(here).values()}
        near = {name for name in parts if isinstance(name, str) and name.startswith(_NETWORKS)}
        waiting |= {
            name
            for name in near
            if "nn" in vars(sys.modules[name]) and f"{name.removeprefix(_NETWORKS)}.py" not in found
        }
    return found


def make_graph(weights: NetworkWeights, openvino: ModuleType) -> Graph:
    """Return the graph of a network; it holds none of its weights.

    Raises:
        ConfigError: a network that is not in the registry, or one that does not use all of its weights.
    """
    declared = declaration(weights.name)
    network = build_network(weights.name, weights.settings).eval()
    values = {key: value for key, value in network.state_dict().items() if not key.endswith(_COUNTS)}
    examples = (torch.zeros(shape(weights)), *values.values())
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("ignore")  # tracing warns of every shape that it takes for a constant
        model = openvino.convert_model(
            _Open(network, list(values)),
            example_input=examples,
            input=[list(example.shape) for example in examples],
        )
    parameters = model.get_parameters()
    if len(parameters) != len(examples):
        raise ConfigError(
            "a network that does not use all of its weights has no graph",
            got=f"{len(parameters) - 1} of {len(values)} tensors",
            allowed="--runtime torch",
        )
    model.set_friendly_name(weights.name)
    for k, layer in enumerate(model.get_ordered_ops()):  # OpenVINO counts on from one model to the next
        layer.set_friendly_name(f"{layer.get_type_name()}_{k}")
    for parameter, key in zip(parameters[1:], values, strict=True):
        parameter.set_friendly_name(key)
    facts = GraphFacts(
        format=FORMAT,
        network=weights.name,
        config=json.loads(json.dumps(asdict(declared.config(**weights.settings)))),
        defaults=json.loads(json.dumps(asdict(declared.config()))),
        image=shape(weights),
        tensors={key: (entry.shape, entry.dtype) for key, entry in entries(network.state_dict()).items()},
        sources=digests(sorted(_sources(type(network).__module__))),
        made_with={"openvino": metadata.version("openvino"), "torch": torch.__version__.split("+")[0]},
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layers.xml"
        openvino.save_model(model, file, compress_to_fp16=False)
        return Graph(facts=facts, layers=file.read_bytes(), constants=file.with_suffix(".bin").read_bytes())
