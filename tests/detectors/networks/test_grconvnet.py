"""GR-ConvNet has the published size and the published checkpoints' entries, written down here by hand."""

from __future__ import annotations

import pytest
import torch

from mpgrasp.detectors.networks.grconvnet import dropped
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.exceptions import ConfigError

LAYERS = {
    "conv1": (32, 4, 9, 9), "conv2": (64, 32, 4, 4), "conv3": (128, 64, 4, 4), "conv4": (128, 64, 4, 4),
    "conv5": (64, 32, 4, 4), "conv6": (32, 32, 9, 9), "pos_output": (1, 32, 2, 2),
    "cos_output": (1, 32, 2, 2), "sin_output": (1, 32, 2, 2), "width_output": (1, 32, 2, 2),
    **{f"res{k}.conv{n}": (128, 128, 3, 3) for k in range(1, 6) for n in (1, 2)},
}  # fmt: skip
NORMS = {"bn1": 32, "bn2": 64, "bn3": 128, "bn4": 64, "bn5": 32} | {
    f"res{k}.bn{n}": 128 for k in range(1, 6) for n in (1, 2)
}


def test_it_has_the_number_of_parameters_that_its_authors_tell() -> None:
    # Kumra et al. 2020 (arXiv:1909.04810): 1,900,900 for RGB-D
    network = build_network("grconvnet", {"channels": 4})
    assert sum(p.numel() for p in network.parameters()) == 1_900_900


def test_state_dict_has_exactly_the_published_entries() -> None:
    state = build_network("grconvnet", {"channels": 4}).state_dict()
    expected: dict[str, tuple[int, ...]] = {}
    for layer, shape in LAYERS.items():
        transposed = layer in ("conv4", "conv5", "conv6")
        expected |= {f"{layer}.weight": shape, f"{layer}.bias": (shape[1 if transposed else 0],)}
    for layer, size in NORMS.items():
        expected |= {f"{layer}.{what}": (size,) for what in ("weight", "bias", "running_mean", "running_var")}
        expected[f"{layer}.num_batches_tracked"] = ()
    assert {key: tuple(value.shape) for key, value in state.items()} == expected


def test_heads_drop_features_in_training_alone() -> None:
    network = build_network("grconvnet", {"features": 8, "dropout": 0.5})
    x = torch.randn(1, 1, 32, 32)
    with torch.inference_mode():
        network.eval()
        assert torch.equal(network(x)[0], network(x)[0])
        network.train()
        assert not torch.equal(network(x)[0], network(x)[0])


def test_what_is_dropped_is_that_share_and_the_mean_stays() -> None:
    torch.manual_seed(2)
    x = torch.ones(3, 8, 100, 90, dtype=torch.float64)
    y = dropped(x, 0.1)
    assert set(y.flatten().tolist()) == {0.0, 1 / 0.9}
    assert (y == 0).double().mean() == pytest.approx(0.1, abs=4 * (0.09 / y.numel()) ** 0.5)
    assert (y != dropped(x, 0.1)).any()
    torch.manual_seed(2)
    assert torch.equal(y, dropped(x, 0.1))


@pytest.mark.parametrize("settings", [{"dropout": 1.0}, {"features": 0}, {"channels": 0}])
def test_unusable_settings_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        build_network("grconvnet", settings)
