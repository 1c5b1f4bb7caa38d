"""Laws of the optimiser."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from torch import nn
from toy_training import SMALL, trainer

from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import NETWORKS, declaration


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.mark.parametrize("name", NETWORKS)
def test_biases_and_normalisations_are_not_decayed_and_all_else_is(
    name: str, shards: Path, tmp_path: Path
) -> None:
    size = declaration(name).input_size
    small = SMALL if name == "dhrnet" else {}
    image = NetworkInput(size=size, scale=20.0)
    run = trainer(shards, tmp_path / "w.safetensors", name=name, settings=small, input=image, batch=1)
    decayed = {
        id(p) for group in run.optimiser.param_groups if group["weight_decay"] for p in group["params"]
    }
    for module in run.network.modules():
        for key, p in module.named_parameters(recurse=False):
            plain = isinstance(module, nn.Conv2d | nn.ConvTranspose2d | nn.Linear) and key == "weight"
            assert (id(p) in decayed) == plain, (type(module), key)
    losses = run.train_step(run.batches.draw(0))
    assert torch.isfinite(losses).all()
