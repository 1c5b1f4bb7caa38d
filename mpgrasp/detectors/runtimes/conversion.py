"""Conversion of a network from torch to OpenVINO, and what of it decides the result."""

from __future__ import annotations

import copy
import inspect
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import torch
from torch import nn

from mpgrasp.detectors.networks.weights import NetworkWeights


class OneOutput(nn.Module):
    """A network with its heads in one tensor (n, 4, H, W)."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return torch.cat(tuple(self.network(image)), dim=1)


def convert(weights: NetworkWeights, openvino: ModuleType) -> Any:
    """Return OpenVINO's model of the network for one image; it folds batch norms when it compiles."""
    image = shape(weights)
    network = OneOutput(copy.deepcopy(weights.network).cpu().float().eval())
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("ignore")  # tracing warns of every shape that it takes for a constant
        return openvino.convert_model(network, example_input=torch.zeros(image), input=[image])


def shape(weights: NetworkWeights) -> tuple[int, int, int, int]:
    """Return the shape of the network's input for one image."""
    return 1, weights.input.channels, weights.input.size, weights.input.size


def content(weights: NetworkWeights) -> Iterator[bytes]:
    """Yield code and numbers of a network, which decide what it computes."""
    layers = {type(layer) for layer in weights.network.modules()}
    sources = {inspect.getfile(layer) for layer in layers if not layer.__module__.startswith("torch.")}
    for source in sorted({*sources, __file__}):
        yield Path(source).read_bytes()
    for key, value in sorted(weights.network.state_dict().items()):
        yield key.encode()
        yield value.detach().cpu().contiguous().numpy().tobytes()
