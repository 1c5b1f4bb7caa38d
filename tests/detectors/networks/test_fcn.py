"""The ablations of Fig. 8 differ in what they are meant to differ in, and in nothing else."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from mpgrasp.detectors.networks.fcn import FCN, FCNConfig, ResidualFCN
from mpgrasp.detectors.networks.unet import UNet

CONFIG = FCNConfig(width=3, blocks=2)


def silenced(network: FCN) -> FCN:
    """The network with its coarsest level cut off: the decoder gets nothing from below."""
    network.reduce[0].register_forward_hook(lambda _, __, y: torch.zeros_like(y))
    return network.eval()


@pytest.mark.parametrize("kind", [FCN, ResidualFCN])
def test_without_skip_connections_all_goes_through_the_coarsest_level(kind: type[FCN]) -> None:
    network = silenced(kind(CONFIG))
    with torch.inference_mode():
        a, b = (network(torch.randn(1, 1, 64, 64))[0] for _ in range(2))
    assert torch.equal(a, b)


def test_with_skip_connections_it_does_not() -> None:
    network = silenced(UNet(CONFIG))
    with torch.inference_mode():
        a, b = (network(torch.randn(1, 1, 64, 64))[0] for _ in range(2))
    assert not torch.allclose(a, b)


@pytest.mark.parametrize("kind", [FCN, ResidualFCN])
def test_only_a_residual_block_lets_its_input_through(kind: type[FCN]) -> None:
    network = kind(CONFIG).eval()
    block = network.down[2][1]  # type: ignore[index]
    for layer in block.body:
        if isinstance(layer, nn.Conv2d):
            nn.init.zeros_(layer.weight)
    x = torch.rand(1, 12, 8, 8)
    with torch.inference_mode():
        assert torch.equal(block(x), x if kind is ResidualFCN else torch.zeros_like(x))


def test_levels_are_from_a_half_to_a_thirty_second() -> None:
    network, sides = FCN(CONFIG).eval(), []
    for level in (*network.down, *network.up):
        level.register_forward_hook(lambda _, __, y: sides.append(y.shape[-1]))
    with torch.inference_mode():
        network(torch.randn(1, 1, 64, 64))
    assert sides == [32, 16, 8, 4, 2, 4, 8, 16, 32]


def test_plain_and_residual_have_the_same_3x3_convolutions() -> None:
    def convolutions(network: nn.Module) -> list[tuple[int, ...]]:
        layers = [m for m in network.modules() if isinstance(m, nn.Conv2d) and m.kernel_size == (3, 3)]
        return [tuple(m.weight.shape) for m in layers]

    assert convolutions(FCN(CONFIG)) == convolutions(ResidualFCN(CONFIG))
