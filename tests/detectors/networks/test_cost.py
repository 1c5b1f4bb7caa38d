"""Counts of parameters and operations against counting by hand, and the document that lists them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn

import mpgrasp
from mpgrasp.detectors.networks.cost import document, flops, parameters
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.detectors.networks.tfgrasp import TFGrasp

DOCUMENT = Path(mpgrasp.__file__).parents[1] / "docs" / "networks.md"


def by_hand(network: nn.Module, x: torch.Tensor) -> int:
    """2 x multiply-adds of all convolutions and linear layers, from the shapes that go through them."""
    total, called = 0, set()

    def count(layer: nn.Module, args: tuple[torch.Tensor], y: torch.Tensor) -> None:
        nonlocal total
        called.add(layer)
        weight = layer.weight
        assert isinstance(weight, torch.Tensor)
        # a weight is used once for each place of the output, or of the input if that is the smaller one
        channels_last = isinstance(layer, nn.Linear)
        places = args[0] if isinstance(layer, nn.ConvTranspose2d) else y
        total += 2 * weight.numel() * places.numel() // places.shape[-1 if channels_last else 1]

    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d | nn.Linear):
            layer.register_forward_hook(count)
    with torch.inference_mode():
        network.eval()(x)
    if not isinstance(network, TFGrasp):
        side = x.shape[-1] // 2  # heads computed as one make no calls of their own; they work at half size
        heads = [layer for name, layer in network.named_children() if name.endswith("_output")]
        total += sum(2 * head.weight.numel() * side**2 for head in heads if head not in called)  # type: ignore
    return total


@pytest.mark.parametrize(
    ("name", "settings", "size"),
    [
        ("dhrnet", {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1}, 64),
        ("ggcnn", {}, 60),
        ("ggcnn2", {}, 64),
        ("fcn_residual", {"width": 3, "blocks": 1}, 64),
        ("unet", {"width": 3, "blocks": 1}, 64),
    ],
)
def test_operations_are_those_of_the_layers(name: str, settings: dict[str, Any], size: int) -> None:
    network = build_network(name, {**settings, "channels": 3})
    assert flops(network, 3, size) == by_hand(network, torch.zeros(1, 3, size, size))


def test_attention_counts() -> None:
    network = build_network("tfgrasp", {"size": 64, "embed": 8, "window": 2})
    layers = by_hand(network, torch.zeros(1, 1, 64, 64))
    heads = 2 * 4 * 8 * 64 * 64  # one linear map in place of the four convolutions
    # two products of a window's 4 tokens with each other; both directions at the three finer resolutions
    stages = [(16, 8, 4), (8, 16, 4), (4, 32, 4), (2, 64, 2)]  # side, width and blocks
    attention = sum(2 * blocks * 2 * 4 * side**2 * width for side, width, blocks in stages)
    assert flops(network, 1, 64) == layers + heads + attention


def test_counting_leaves_the_network_as_it_was() -> None:
    network = build_network("ggcnn2", {})
    flops(network, 1, 64)
    assert network.training
    assert next(network.parameters()).device.type == "cpu"


def test_parameters_are_those_of_the_published_networks() -> None:
    assert parameters(build_network("ggcnn", {})) == 62_420  # "62k" in the RSS paper
    assert parameters(build_network("ggcnn2", {})) == 66_676


def test_the_ablations_are_as_large_as_the_network_they_are_compared_with() -> None:
    reference = build_network("dhrnet", {})
    for name in ("fcn", "fcn_residual", "unet"):
        network = build_network(name, {})
        assert parameters(network) == pytest.approx(parameters(reference), rel=0.1)
        assert flops(network, 1, 224) == pytest.approx(flops(reference, 1, 224), rel=0.15)


def test_the_document_is_what_the_command_prints() -> None:
    assert DOCUMENT.read_text() == document()
