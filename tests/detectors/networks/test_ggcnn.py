"""The networks have the published checkpoints' entries, written down here by hand from those files."""

from __future__ import annotations

import pytest
import torch

from mpgrasp.detectors.networks.ggcnn import GGCNN2
from mpgrasp.detectors.networks.registry import build_network

PUBLISHED = {
    "ggcnn": {
        "conv1": (32, 1, 9, 9),
        "conv2": (16, 32, 5, 5),
        "conv3": (8, 16, 3, 3),
        "convt1": (8, 8, 3, 3),
        "convt2": (8, 16, 5, 5),
        "convt3": (16, 32, 9, 9),
        "pos_output": (1, 32, 2, 2),
        "cos_output": (1, 32, 2, 2),
        "sin_output": (1, 32, 2, 2),
        "width_output": (1, 32, 2, 2),
    },
    "ggcnn2": {
        "features.0": (16, 1, 11, 11),
        "features.2": (16, 16, 5, 5),
        "features.5": (16, 16, 5, 5),
        "features.7": (16, 16, 5, 5),
        "features.10": (32, 16, 5, 5),
        "features.12": (32, 32, 5, 5),
        "features.15": (16, 32, 3, 3),
        "features.18": (16, 16, 3, 3),
        "pos_output": (1, 16, 1, 1),
        "cos_output": (1, 16, 1, 1),
        "sin_output": (1, 16, 1, 1),
        "width_output": (1, 16, 1, 1),
    },
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_state_dict_has_exactly_the_published_entries(name: str) -> None:
    state = build_network(name, {}).state_dict()
    expected: dict[str, tuple[int, ...]] = {}
    for layer, shape in PUBLISHED[name].items():
        # transposed convolutions keep (in, out): their bias has the second size
        expected[f"{layer}.weight"] = shape
        expected[f"{layer}.bias"] = (shape[1] if layer.startswith("convt") else shape[0],)
    assert {k: tuple(v.shape) for k, v in state.items()} == expected


@pytest.mark.parametrize(("name", "size"), [("ggcnn", 300), ("ggcnn", 228), ("ggcnn2", 224), ("ggcnn2", 300)])
def test_every_head_has_a_value_for_every_pixel(name: str, size: int) -> None:
    network = build_network(name, {}).eval()
    with torch.inference_mode():
        heads = network(torch.randn(1, 1, size, size))
    assert [tuple(h.shape) for h in heads] == [(1, 1, size, size)] * 4


def test_upsampling_aligns_corners_as_published() -> None:
    features = GGCNN2().features
    assert isinstance(features, torch.nn.Sequential)
    ramp = torch.arange(4.0).expand(1, 1, 4, 4)
    assert torch.allclose(features[14](ramp)[0, 0, 0], torch.linspace(0, 3, 8))
