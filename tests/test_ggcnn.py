"""The networks have the published checkpoints' entries, written down here by hand from those files."""

from __future__ import annotations

import pytest
import torch

from mpgrasp.detectors.ggcnn import GGCNNConfig, make_ggcnn
from mpgrasp.exceptions import ConfigError

PUBLISHED = {
    1: {
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
    2: {
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


@pytest.mark.parametrize("variant", [1, 2])
def test_state_dict_has_exactly_the_published_entries(variant: int) -> None:
    state = make_ggcnn(GGCNNConfig(variant=variant)).state_dict()
    expected: dict[str, tuple[int, ...]] = {}
    for layer, shape in PUBLISHED[variant].items():
        # transposed convolutions keep (in, out): their bias has the second size
        expected[f"{layer}.weight"] = shape
        expected[f"{layer}.bias"] = (shape[1] if layer.startswith("convt") else shape[0],)
    assert {k: tuple(v.shape) for k, v in state.items()} == expected


@pytest.mark.parametrize(("variant", "size"), [(1, 300), (2, 224), (2, 300)])
def test_every_head_has_a_value_for_every_pixel(variant: int, size: int) -> None:
    network = make_ggcnn(GGCNNConfig(variant=variant)).eval()
    with torch.inference_mode():
        heads = network(torch.randn(1, 1, size, size))
    assert [tuple(h.shape) for h in heads] == [(1, 1, size, size)] * 4


def test_upsampling_aligns_corners_as_published() -> None:
    features = make_ggcnn().features
    assert isinstance(features, torch.nn.Sequential)
    ramp = torch.arange(4.0).expand(1, 1, 4, 4)
    assert torch.allclose(features[14](ramp)[0, 0, 0], torch.linspace(0, 3, 8))


@pytest.mark.parametrize("bad", [{"variant": 3}, {"channels": 0}])
def test_settings_that_make_no_network_are_refused(bad: dict) -> None:
    with pytest.raises(ConfigError):
        GGCNNConfig(**bad)
